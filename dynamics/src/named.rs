//! Enums whose variants have names in files and on the command line.

/// Declares an enum without fields together with the names of its variants, so that each name stands once. `ALL` and `NAMES` list variants
/// and names in the order of declaration, `name` returns the name of a variant, and `named` finds the variant of a name.
#[macro_export]
macro_rules! named {
    ($(#[$of_enum:meta])* $vis:vis enum $enum:ident { $($(#[$of_variant:meta])* $variant:ident = $name:literal,)+ }) => {
        $(#[$of_enum])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $vis enum $enum {
            $($(#[$of_variant])* $variant,)+
        }

        impl $enum {
            /// All variants, in order.
            $vis const ALL: [$enum; [$($name),+].len()] = [$($enum::$variant),+];

            /// The names of all variants.
            $vis const NAMES: [&'static str; [$($name),+].len()] = [$($name),+];

            /// Returns the name.
            $vis const fn name(self) -> &'static str {
                $enum::NAMES[self as usize]
            }

            /// Returns the variant with a name.
            $vis fn named(name: &str) -> Option<$enum> {
                $enum::ALL.into_iter().find(|variant| variant.name() == name)
            }
        }
    };
}
