//! From type to type; bits and numbers.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::logic::bits;
use crate::select::from_gray;

/// A conversion within the range of the target, or cut to its bits; and whether the value is outside.
macro_rules! convert {
    ($Name:ident, $kind:literal, $from:ty, $to:ty, $zero:expr, $zero_out:expr, $doc:literal, $unclamped:literal, |$in:ident, $clamp:ident| $convert:expr) => {
        component! {
            #[doc = $doc]
            $Name = $kind;
            in { in_: $from = $zero, "value"; clamp: bool = false, $unclamped; }
            out { out: $to = $zero_out, "the same value"; out_of_range: bool = false, "it is outside of the range"; }
        }

        impl Component for $Name {
            fn update(&mut self, _: f64) {
                let ($in, $clamp) = (self.in_, self.clamp);
                if let Some((out, out_of_range)) = $convert {
                    (self.out, self.out_of_range) = (out, out_of_range);
                } else {
                    self.out_of_range = true;
                }
            }
        }
    };
}

/// A number as an integer from `min` to `max`, cut toward 0; none where it is no number. RT.
fn integer(value: f64, clamp: bool, min: i64, max: i64) -> Option<(i64, bool)> {
    if value.is_nan() {
        return None;
    }
    // Beyond the range of 64 bits there are no fractions, and no lower bits to keep.
    let cut = value as i64;
    let outside = value < min as f64 || value > max as f64;
    Some((if clamp { cut.clamp(min, max) } else { cut }, outside))
}

convert!(
    ConvFloatS32,
    "conv_float_s32",
    f64,
    i32,
    0.0,
    0,
    " Number to signed integer, cut toward 0.",
    "holds it within the range of the other type; else the upper bits are lost",
    |value, clamp| integer(value, clamp, i64::from(i32::MIN), i64::from(i32::MAX))
        .map(|(cut, outside)| (cut as i32, outside))
);
convert!(
    ConvFloatU32,
    "conv_float_u32",
    f64,
    u32,
    0.0,
    0,
    " Number to unsigned integer, cut toward 0.",
    "holds it within the range of the other type; else the upper bits are lost",
    |value, clamp| integer(value, clamp, 0, i64::from(u32::MAX)).map(|(cut, outside)| (cut as u32, outside))
);
convert!(
    ConvS32U32,
    "conv_s32_u32",
    i32,
    u32,
    0,
    0,
    " Signed integer to unsigned one.",
    "holds it within the range of the other type; else the upper bits are lost",
    |value, clamp| Some((if clamp { value.max(0) } else { value } as u32, value < 0))
);
convert!(
    ConvU32S32,
    "conv_u32_s32",
    u32,
    i32,
    0,
    0,
    " Unsigned integer to signed one.",
    "holds it within the range of the other type; else the upper bits are lost",
    |value, clamp| Some((
        if clamp { value.min(i32::MAX as u32) } else { value } as i32,
        value > i32::MAX as u32
    ))
);
convert!(
    ConvS32Bit,
    "conv_s32_bit",
    i32,
    bool,
    0,
    false,
    " Signed integer to bit.",
    "holds it at 0 where it is below; else any bit counts",
    |value, clamp| Some((if clamp { value > 0 } else { value != 0 }, !(0..=1).contains(&value)))
);
convert!(
    ConvU32Bit,
    "conv_u32_bit",
    u32,
    bool,
    0,
    false,
    " Unsigned integer to bit.",
    "has no effect: any bit counts",
    |value, _clamp| Some((value != 0, value > 1))
);

/// A conversion that always fits.
macro_rules! widen {
    ($Name:ident, $kind:literal, $from:ty, $to:ty, $zero:expr, $zero_out:expr, $doc:literal) => {
        component! {
            #[doc = $doc]
            $Name = $kind;
            in { in_: $from = $zero, "value"; }
            out { out: $to = $zero_out, "the same value"; }
        }

        impl Component for $Name {
            fn update(&mut self, _: f64) {
                self.out = self.in_.into();
            }
        }
    };
}

widen!(
    ConvBitFloat,
    "conv_bit_float",
    bool,
    f64,
    false,
    0.0,
    " Bit to number, 0 or 1."
);
widen!(
    ConvBitS32,
    "conv_bit_s32",
    bool,
    i32,
    false,
    0,
    " Bit to signed integer, 0 or 1."
);
widen!(
    ConvBitU32,
    "conv_bit_u32",
    bool,
    u32,
    false,
    0,
    " Bit to unsigned integer, 0 or 1."
);
widen!(
    ConvS32Float,
    "conv_s32_float",
    i32,
    f64,
    0,
    0.0,
    " Signed integer to number."
);
widen!(
    ConvU32Float,
    "conv_u32_float",
    u32,
    f64,
    0,
    0.0,
    " Unsigned integer to number."
);

component! {
    /// The bits of a number.
    Bitslice = "bitslice";
    options { personality: 32, 1..=32, [], "number of bits"; }
    in { in_: u32 = 0, "number"; }
    out { out as "out-##": Vec<bool> = vec![false; 32], "bit"; }
}

impl Component for Bitslice {
    fn shape(&mut self, options: &Options<'_>) {
        self.out = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        for (at, out) in self.out.iter_mut().take(32).enumerate() {
            *out = self.in_ >> at & 1 != 0;
        }
    }
}

component! {
    /// The number that bits make.
    Bitmerge = "bitmerge";
    options { personality: 32, 1..=32, [], "number of bits"; }
    in { in_ as "in-##": Vec<bool> = vec![false; 32], "bit"; }
    out { out: u32 = 0, "number"; }
}

impl Component for Bitmerge {
    fn shape(&mut self, options: &Options<'_>) {
        self.in_ = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        self.out = bits(&self.in_);
    }
}

component! {
    /// Gray code to number.
    Gray2bin = "gray2bin";
    in { in_: u32 = 0, "Gray code"; }
    out { out: u32 = 0, "number"; }
}

impl Component for Gray2bin {
    fn update(&mut self, _: f64) {
        self.out = from_gray(self.in_);
    }
}

component! {
    /// Number to Gray code.
    Bin2gray = "bin2gray";
    in { in_: u32 = 0, "number"; }
    out { out: u32 = 0, "Gray code"; }
}

impl Component for Bin2gray {
    fn update(&mut self, _: f64) {
        self.out = self.in_ ^ self.in_ >> 1;
    }
}

component! {
    /// A number to the bit that stands for it, or such bits to their number: what a Modbus register says in one word.
    Enumeration = "enum";
    options {
        mode: 0, 0..=1, ["decode", "encode"], "from the number to bits, or from bits to the number";
        size: 4, 1..=256, [], "number of bits";
    }
    in {
        input: Vec<u32> = Vec::new(), "number";
        in_ as "in-##": Vec<bool> = Vec::new(), "bit";
        val as "val-##": Vec<u32> = Vec::new(), "number that bit NN stands for, first NN";
    }
    out {
        out as "out-##": Vec<bool> = Vec::new(), "the number is that of the bit";
        output: Vec<u32> = Vec::new(), "number of the bit that is set, of several that of the last; 0 where none is";
    }
}

impl Component for Enumeration {
    fn shape(&mut self, options: &Options<'_>) {
        let size = options.count("size");
        self.val = (0..size as u32).collect();
        match options.get("mode") {
            0 => (self.input, self.out) = (vec![0], vec![false; size]),
            _ => (self.output, self.in_) = (vec![0], vec![false; size]),
        }
    }

    fn update(&mut self, _: f64) {
        for (out, val) in self.out.iter_mut().zip(&self.val) {
            *out = self.input.first() == Some(val);
        }
        let mut set = self.in_.iter().zip(&self.val).filter(|(bit, _)| **bit);
        self.output.fill(set.next_back().map_or(0, |(_, val)| *val));
    }
}
