//! Parameters, headers and items of pages that operations of the OpenAPI document share: each
//! stands once in `components`, and operations refer to it. In: the whole document. Out: the same
//! contract, shorter.

use std::collections::BTreeMap;
use utoipa::openapi::{
    OpenApi, Ref, RefOr,
    header::Header,
    path::{Operation, Parameter, ParameterIn, PathItem},
    schema::{ArrayItems, Schema},
};

/// Parts of forms that are JSON: the form, the part, and the schema of its content.
const JSON_PARTS: [(&str, &str, &str); 5] = [
    ("NewViewForm", "capture", "CaptureMetadata"),
    ("PhotographForm", "intrinsics", "Intrinsics"),
    ("LocaliseForm", "intrinsics", "Intrinsics"),
    ("LocaliseForm", "mounting", "Pose3"),
    ("LocaliseForm", "scan", "ScanBody"),
];

/// Puts what is used twice in `components`.
pub(super) fn with_components(mut document: OpenApi) -> OpenApi {
    let (parameters, headers) = shared(&mut document);
    for operation in operations(&mut document) {
        for parameter in operation.parameters.iter_mut().flatten() {
            if let RefOr::T(own) = parameter
                && parameters.get(&name_of(own)).is_some_and(|shared| shared == own)
            {
                *parameter = RefOr::Ref(Ref::new(format!("#/components/parameters/{}", name_of(own))));
            }
        }
        for response in operation.responses.responses.values_mut() {
            let RefOr::T(response) = response else { continue };
            for (name, header) in &mut response.headers {
                if headers.contains_key(name) {
                    *header = RefOr::Ref(Ref::new(format!("#/components/headers/{name}")));
                }
            }
        }
    }
    let components = document.components.get_or_insert_default();
    components.parameters.extend(parameters.into_iter().map(|(name, one)| (name, RefOr::T(one))));
    components.headers.extend(headers.into_iter().map(|(name, one)| (name, RefOr::T(one))));
    refer_to_items(&mut components.schemas);
    say_what_parts_hold(&mut components.schemas);
    document
}

fn say_what_parts_hold(schemas: &mut BTreeMap<String, RefOr<Schema>>) {
    for (form, part, content) in JSON_PARTS {
        if let Some(RefOr::T(Schema::Object(form))) = schemas.get_mut(form)
            && let Some(RefOr::T(Schema::Object(part))) = form.properties.get_mut(part)
        {
            "application/json".clone_into(&mut part.content_media_type);
            part.content_schema = Some(Box::new(RefOr::Ref(Ref::from_schema_name(content))));
        }
    }
}

/// `Page_Map` is a page of `Map`: its items are made out of line.
fn refer_to_items(schemas: &mut BTreeMap<String, RefOr<Schema>>) {
    let names: Vec<String> = schemas.keys().cloned().collect();
    for (name, schema) in schemas {
        let item = name.strip_prefix("Page_").filter(|item| names.iter().any(|known| known == item));
        if let (Some(item), RefOr::T(Schema::Object(page))) = (item, schema)
            && let Some(RefOr::T(Schema::Array(items))) = page.properties.get_mut("items")
        {
            items.items = ArrayItems::RefOrSchema(Box::new(RefOr::Ref(Ref::from_schema_name(item))));
        }
    }
}

/// The parameters and headers that more than one operation has in the same words. Of several of one
/// name, those that most operations have.
fn shared(document: &mut OpenApi) -> (BTreeMap<String, Parameter>, BTreeMap<String, Header>) {
    let mut parameters: Vec<(usize, Parameter)> = Vec::new();
    let mut headers: BTreeMap<String, (usize, Header)> = BTreeMap::new();
    for operation in operations(document) {
        for parameter in operation.parameters.iter().flatten() {
            let RefOr::T(parameter) = parameter else { continue };
            match parameters.iter_mut().find(|(_, known)| known == parameter) {
                Some((count, _)) => *count += 1,
                None => parameters.push((1, parameter.clone())),
            }
        }
        for response in operation.responses.responses.values() {
            let RefOr::T(response) = response else { continue };
            for (name, header) in &response.headers {
                if let RefOr::T(header) = header {
                    headers.entry(name.clone()).or_insert_with(|| (0, header.clone())).0 += 1;
                }
            }
        }
    }
    parameters.retain(|(count, _)| *count > 1);
    parameters.sort_by_key(|(count, _)| *count);
    let parameters = parameters.into_iter().map(|(_, one)| (name_of(&one), one)).collect();
    let headers = headers.into_iter().filter(|(_, (count, _))| *count > 1);
    (parameters, headers.map(|(name, (_, header))| (name, header)).collect())
}

/// The name of a parameter in `components`: where it stands in a request, and what it is called
/// there.
fn name_of(parameter: &Parameter) -> String {
    let place = match parameter.parameter_in {
        ParameterIn::Path => "path",
        ParameterIn::Query => "query",
        ParameterIn::Header => "header",
        _ => "other",
    };
    format!("{place}.{}", parameter.name)
}

/// Every operation.
fn operations(document: &mut OpenApi) -> impl Iterator<Item = &mut Operation> {
    document.paths.paths.values_mut().flat_map(|item| {
        let PathItem { get, put, post, patch, delete, .. } = item;
        [get, put, post, patch, delete].into_iter().flatten()
    })
}
