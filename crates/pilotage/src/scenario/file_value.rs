//! Values of a model file that can be written in more than one way, or whose order counts.

use std::fmt;
use std::marker::PhantomData;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::model::Interval;

/// Ends of an interval for some of the state variables, by name. The low end belongs to it, the high end does not;
/// `-inf` and `inf` leave a side open.
pub(super) type Sides = std::collections::BTreeMap<String, Ends>;

/// Lower and upper end of an interval: `[low, high]`.
#[derive(Debug, Clone, Copy, JsonSchema)]
pub(super) struct Ends(#[schemars(with = "[f64; 2]")] pub Interval);

impl<'de> Deserialize<'de> for Ends {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EndsVisitor;

        impl<'de> Visitor<'de> for EndsVisitor {
            type Value = Ends;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("two numbers, [low, high]")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Ends, A::Error> {
                match Vec::deserialize(SeqAccessDeserializer::new(list))?[..] {
                    [low, high] => Ok(Ends(Interval::new(low, high))),
                    ref ends => Err(A::Error::invalid_length(ends.len(), &self)),
                }
            }
        }

        deserializer.deserialize_seq(EndsVisitor)
    }
}

/// A number, or an expression of it: `"0.01 + 0.1*abs(x)"`.
///
/// An expression knows the state variables by name, the controls of the action `u1`, `u2`, ... and the step of the episode `t`, counted
/// from 0; `pi`, `e` and `inf`; `+ - * / % ^`, comparisons, `and or not`; and the functions abs sqrt exp ln log10 sin cos tan asin acos
/// atan atan2 hypot min max pow sign floor round clamp(x, low, high) if(condition, then, else). `-x^2` is `-(x^2)`.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub(super) enum Scalar {
    /// A number.
    Number(f64),
    /// An expression, in quotes.
    Expression(String),
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ScalarVisitor;

        impl Visitor<'_> for ScalarVisitor {
            type Value = Scalar;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, or an expression in quotes")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Scalar, E> {
                Ok(Scalar::Expression(text.to_owned()))
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Scalar, E> {
                Ok(Scalar::Number(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Scalar, E> {
                Ok(Scalar::Number(value as f64))
            }
        }

        deserializer.deserialize_any(ScalarVisitor)
    }
}

/// One value, or a list of such values.
#[derive(Debug, JsonSchema)]
#[schemars(untagged)]
pub(super) enum OneOrMany<T> {
    /// One value.
    One(T),
    /// A list of values.
    Many(Vec<T>),
}

impl<T> OneOrMany<T> {
    pub(super) fn as_slice(&self) -> &[T] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OneOrMany<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrManyVisitor<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for OneOrManyVisitor<T> {
            type Value = OneOrMany<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("one value or a list of them")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
                T::deserialize(serde::de::value::StrDeserializer::new(text)).map(OneOrMany::One)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(OneOrMany::One)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(OneOrMany::Many)
            }
        }

        deserializer.deserialize_any(OneOrManyVisitor(PhantomData))
    }
}

/// A region: intervals of some state variables, or all cells of the map with a mark.
#[derive(Debug, JsonSchema)]
#[schemars(untagged)]
pub(super) enum Where {
    /// A mark of the map, one character, or `#` for its blocked cells and all beyond its edges.
    Mark(String),
    /// Intervals by name of the state variable; variables that are not named are free.
    Box(Sides),
}

impl<'de> Deserialize<'de> for Where {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct WhereVisitor;

        impl<'de> Visitor<'de> for WhereVisitor {
            type Value = Where;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("intervals such as { x = [0.0, 1.0] }, or a mark of the map in quotes")
            }

            fn visit_str<E: Error>(self, mark: &str) -> Result<Where, E> {
                Ok(Where::Mark(mark.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Where, A::Error> {
                Sides::deserialize(MapAccessDeserializer::new(map)).map(Where::Box)
            }
        }

        deserializer.deserialize_any(WhereVisitor)
    }
}

/// A table of named things, in the order of the file.
#[derive(Debug)]
pub(super) struct Named<T>(pub Vec<(String, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NamedVisitor<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for NamedVisitor<T> {
            type Value = Named<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of named entries")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries: Vec<(toml::Spanned<String>, T)> = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                entries.sort_by_key(|(name, _)| name.span().start);
                Ok(Named(
                    entries
                        .into_iter()
                        .map(|(name, entry)| (name.into_inner(), entry))
                        .collect(),
                ))
            }
        }

        deserializer.deserialize_map(NamedVisitor(PhantomData))
    }
}
