//! What the authorisation table says, in the OpenAPI document: the way to send a token, and the
//! role that each operation needs.

use crate::identity::authorisation::{Access, Scope, access};
use utoipa::openapi::{
    OpenApi, RefOr,
    security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme},
};

/// Name of the scheme in the document.
const SCHEME: &str = "token";
/// What stands beside the role where a token for all maps is needed.
const ALL_MAPS: &str = "all_maps";

/// Says of every operation that needs a token which role is needed, and whether the token must be
/// for all maps.
pub(super) fn with_security(mut document: OpenApi, root: &str) -> OpenApi {
    let scheme =
        HttpBuilder::new().scheme(HttpAuthScheme::Bearer).bearer_format("wmk_ID_SECRET").description(Some(
            "The words beside it are the least role, and `all_maps` where the token must be for all maps.",
        ));
    let components = document.components.get_or_insert_default();
    components.security_schemes.insert(SCHEME.to_owned(), RefOr::T(SecurityScheme::Http(scheme.build())));
    for (path, item) in &mut document.paths.paths {
        let below = path.strip_prefix(root).unwrap_or(path);
        let methods = [
            ("GET", &mut item.get),
            ("POST", &mut item.post),
            ("PUT", &mut item.put),
            ("PATCH", &mut item.patch),
            ("DELETE", &mut item.delete),
        ];
        for (method, operation) in methods {
            if let (Some(operation), Some(Access::Needs(role, scope))) = (operation, access(method, below)) {
                let needed = [Some(role.to_string()), (scope == Scope::Server).then(|| ALL_MAPS.to_owned())];
                let needed = SecurityRequirement::new(SCHEME, needed.into_iter().flatten());
                operation.security = Some(vec![needed]);
            }
        }
    }
    document
}
