//! Objects alone where a field is known by its name, and text that every store takes. In: any
//! reader of serde. Out: the same, but for structs from lists and for U+0000.
//!
//! serde's derive takes a list of values in the order of the fields for a struct. No schema of this
//! interface says so, the order is no promise, and a body that is taken by accident is a change
//! that nobody meant. A list gets the error of any other wrong type, and a path to it.

use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, MapAccess, SeqAccess, VariantAccess, Visitor,
};
use std::fmt;

/// A reader, a visitor or a part of either, whose structs are objects.
pub(super) struct Objects<T>(pub(super) T);

/// A visitor of a struct: it takes an object, and no list.
struct OfStruct<V>(V);

/// Refuses text that not every store takes: PostgreSQL has no U+0000.
fn storable<E: Error>(text: &str) -> Result<&str, E> {
    if text.contains('\0') { Err(E::custom("a text has no U+0000")) } else { Ok(text) }
}

/// Hands a value of each of these types on as it is.
macro_rules! handed_on {
    ($($visit:ident($kind:ty)),*) => {
        $(fn $visit<E: Error>(self, value: $kind) -> Result<V::Value, E> {
            self.0.$visit(value)
        })*
    };
}

/// Asks for a value of each of these types, by a visitor of the same kind.
macro_rules! asked_for {
    ($($ask:ident($($name:ident: $kind:ty),*)),*) => {
        $(fn $ask<V: Visitor<'de>>(self, $($name: $kind,)* visitor: V) -> Result<V::Value, D::Error> {
            self.0.$ask($($name,)* Objects(visitor))
        })*
    };
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Objects<D> {
    type Error = D::Error;

    asked_for!(
        deserialize_any(), deserialize_bool(), deserialize_i8(), deserialize_i16(), deserialize_i32(), deserialize_i64(),
        deserialize_i128(), deserialize_u8(), deserialize_u16(), deserialize_u32(), deserialize_u64(), deserialize_u128(),
        deserialize_f32(), deserialize_f64(), deserialize_char(), deserialize_str(), deserialize_string(),
        deserialize_bytes(), deserialize_byte_buf(), deserialize_option(), deserialize_unit(), deserialize_seq(),
        deserialize_map(), deserialize_identifier(), deserialize_ignored_any(),
        deserialize_unit_struct(name: &'static str), deserialize_newtype_struct(name: &'static str),
        deserialize_tuple(len: usize), deserialize_tuple_struct(name: &'static str, len: usize),
        deserialize_enum(name: &'static str, variants: &'static [&'static str])
    );

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct(name, fields, OfStruct(visitor))
    }

    fn is_human_readable(&self) -> bool {
        self.0.is_human_readable()
    }
}

impl<'de, V: Visitor<'de>> Visitor<'de> for OfStruct<V> {
    type Value = V::Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object with fields by name")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<V::Value, A::Error> {
        self.0.visit_map(Objects(map))
    }
}

impl<'de, V: Visitor<'de>> Visitor<'de> for Objects<V> {
    type Value = V::Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(formatter)
    }

    handed_on!(
        visit_bool(bool),
        visit_i8(i8),
        visit_i16(i16),
        visit_i32(i32),
        visit_i64(i64),
        visit_i128(i128),
        visit_u8(u8),
        visit_u16(u16),
        visit_u32(u32),
        visit_u64(u64),
        visit_u128(u128),
        visit_f32(f32),
        visit_f64(f64),
        visit_char(char),
        visit_bytes(&[u8]),
        visit_borrowed_bytes(&'de [u8]),
        visit_byte_buf(Vec<u8>)
    );

    fn visit_str<E: Error>(self, text: &str) -> Result<V::Value, E> {
        self.0.visit_str(storable(text)?)
    }

    fn visit_borrowed_str<E: Error>(self, text: &'de str) -> Result<V::Value, E> {
        self.0.visit_borrowed_str(storable(text)?)
    }

    fn visit_string<E: Error>(self, text: String) -> Result<V::Value, E> {
        storable(&text)?;
        self.0.visit_string(text)
    }

    fn visit_none<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_none()
    }

    fn visit_unit<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_unit()
    }

    fn visit_some<D: Deserializer<'de>>(self, inner: D) -> Result<V::Value, D::Error> {
        self.0.visit_some(Objects(inner))
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, inner: D) -> Result<V::Value, D::Error> {
        self.0.visit_newtype_struct(Objects(inner))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<V::Value, A::Error> {
        self.0.visit_seq(Objects(seq))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<V::Value, A::Error> {
        self.0.visit_map(Objects(map))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<V::Value, A::Error> {
        self.0.visit_enum(Objects(data))
    }
}

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Objects<S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, inner: D) -> Result<S::Value, D::Error> {
        self.0.deserialize(Objects(inner))
    }
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for Objects<A> {
    type Error = A::Error;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_element_seed(Objects(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Objects<A> {
    type Error = A::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_key_seed(Objects(seed))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.0.next_value_seed(Objects(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: EnumAccess<'de>> EnumAccess<'de> for Objects<A> {
    type Error = A::Error;
    type Variant = Objects<A::Variant>;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self::Variant), A::Error> {
        self.0.variant_seed(Objects(seed)).map(|(value, variant)| (value, Objects(variant)))
    }
}

impl<'de, A: VariantAccess<'de>> VariantAccess<'de> for Objects<A> {
    type Error = A::Error;

    fn unit_variant(self) -> Result<(), A::Error> {
        self.0.unit_variant()
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, A::Error> {
        self.0.newtype_variant_seed(Objects(seed))
    }

    fn tuple_variant<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, A::Error> {
        self.0.tuple_variant(len, Objects(visitor))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, A::Error> {
        self.0.struct_variant(fields, OfStruct(visitor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use std::collections::BTreeMap;

    #[derive(Debug, Deserialize, PartialEq)]
    struct Point {
        x_m: f64,
        y_m: Option<f64>,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    enum Shape {
        None,
        At(Point),
        Box { from: Point, to: Point },
    }

    #[derive(Debug, Deserialize, PartialEq)]
    struct Body {
        corners: [f64; 2],
        points: Vec<Point>,
        named: BTreeMap<String, Point>,
        best: Option<Point>,
        shapes: Vec<Shape>,
    }

    /// The path to what is wrong.
    fn read(text: &str) -> Result<Body, String> {
        let mut reader = serde_json::Deserializer::from_str(text);
        serde_path_to_error::deserialize(Objects(&mut reader))
            .map_err(|e| format!("{}: {}", e.path(), e.inner()))
    }

    const WHOLE: &str = r#"{"corners": [1, 2], "points": [{"x_m": 1, "y_m": null}], "named": {"a": {"x_m": 2}},
        "best": {"x_m": 3}, "shapes": ["None", {"At": {"x_m": 4}}, {"Box": {"from": {"x_m": 5}, "to": {"x_m": 6}}}]}"#;

    #[test]
    fn a_list_is_no_struct_wherever_it_stands() {
        assert!(read(WHOLE).is_ok(), "{:?}", read(WHOLE));
        let whole: Body = serde_json::from_str(WHOLE).unwrap();
        assert_eq!(read(WHOLE).unwrap(), whole, "as without");
        for (object, list, path) in [
            (r#"{"x_m": 1, "y_m": null}"#, "[1, null]", "points[0]"),
            (r#"{"x_m": 2}"#, "[2, null]", "named.a"),
            (r#"{"x_m": 3}"#, "[3, null]", "best"),
            (r#"{"x_m": 4}"#, "[4, null]", "shapes[1].At"),
            (r#"{"x_m": 6}"#, "[6, null]", "shapes[2].Box.to"),
            (r#"{"from": {"x_m": 5}, "to": {"x_m": 6}}"#, r#"[{"x_m": 5}, {"x_m": 6}]"#, "shapes[2].Box"),
        ] {
            let text = WHOLE.replace(object, list);
            assert!(serde_json::from_str::<Body>(&text).is_ok(), "serde alone takes {text}");
            let refused = read(&text).unwrap_err();
            let wanted = format!("{path}: invalid type: sequence, expected an object with fields by name");
            assert!(refused.starts_with(&wanted), "{refused}");
        }
        let refused = read(&WHOLE.replace(r#""a""#, r#""a\u0000""#)).unwrap_err();
        assert!(refused.contains("a text has no U+0000"), "{refused}");
        let refused = read("[[1, 2], [], {}, null, []]").unwrap_err();
        assert!(refused.starts_with(".: invalid type: sequence"), "{refused}");
    }
}
