//! The names of the supported nodes.

macro_rules! kinds {
    ($($kind:ident $word:literal),* $(,)?) => {
        /// A node of MaterialX' standard library.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the variants are the names of MaterialX' nodes")]
        pub enum Kind { $($kind),* }

        impl Kind {
            /// All supported nodes.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// The name in `.mtlx` files.
            pub fn word(self) -> &'static str {
                match self { $(Self::$kind => $word),* }
            }
        }
    };
}

kinds! {
    Constant "constant", Texcoord "texcoord", Position "position", Dot "dot",
    Add "add", Subtract "subtract", Multiply "multiply", Divide "divide", Modulo "modulo", Power "power",
    SafePower "safepower", Min "min", Max "max", Atan2 "atan2",
    Absval "absval", Sign "sign", Floor "floor", Ceil "ceil", Round "round", Fract "fract",
    Sin "sin", Cos "cos", Tan "tan", Asin "asin", Acos "acos", Sqrt "sqrt", Ln "ln", Exp "exp",
    Clamp "clamp", Invert "invert", Remap "remap", Contrast "contrast", Smoothstep "smoothstep", Mix "mix",
    Luminance "luminance", TriangleWave "trianglewave",
    DotProduct "dotproduct", Magnitude "magnitude", Distance "distance", Normalize "normalize", Rotate2d "rotate2d",
    Combine2 "combine2", Combine3 "combine3", Separate2 "separate2", Separate3 "separate3", Extract "extract",
    Convert "convert",
    IfGreater "ifgreater", IfGreaterEq "ifgreatereq", IfEqual "ifequal", Switch "switch",
    Noise2d "noise2d", Fractal2d "fractal2d", CellNoise2d "cellnoise2d", WorleyNoise2d "worleynoise2d",
}

impl Kind {
    /// The node of this name.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.word() == word)
    }
}
