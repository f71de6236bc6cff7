//! All components, by name.

use crate::component::Kind;
use std::sync::OnceLock;

/// All kinds, in alphabetical order.
pub static CATALOGUE: [Kind; 102] = [
    crate::arithmetic::Abs::KIND,
    crate::arithmetic::AbsS32::KIND,
    crate::logic::And2::KIND,
    crate::convert::Bin2gray::KIND,
    crate::filters::Biquad::KIND,
    crate::convert::Bitmerge::KIND,
    crate::convert::Bitslice::KIND,
    crate::logic::Bitwise::KIND,
    crate::arithmetic::Blend::KIND,
    crate::timing::Blink::KIND,
    crate::carousel::Carousel::KIND,
    crate::timing::ChargePump::KIND,
    crate::compare::Comp::KIND,
    crate::arithmetic::Constant::KIND,
    crate::convert::ConvBitFloat::KIND,
    crate::convert::ConvBitS32::KIND,
    crate::convert::ConvBitU32::KIND,
    crate::convert::ConvFloatS32::KIND,
    crate::convert::ConvFloatU32::KIND,
    crate::convert::ConvS32Bit::KIND,
    crate::convert::ConvS32Float::KIND,
    crate::convert::ConvS32U32::KIND,
    crate::convert::ConvU32Bit::KIND,
    crate::convert::ConvU32Float::KIND,
    crate::convert::ConvU32S32::KIND,
    crate::counting::Counter::KIND,
    crate::timing::Dbounce::KIND,
    crate::filters::Ddt::KIND,
    crate::limits::Deadzone::KIND,
    crate::timing::Debounce::KIND,
    crate::select::Demux::KIND,
    crate::arithmetic::Div2::KIND,
    crate::timing::EdgePulse::KIND,
    crate::counting::Encoder::KIND,
    crate::convert::Enumeration::KIND,
    crate::safety::EstopLatch::KIND,
    crate::arithmetic::Feedcomp::KIND,
    crate::logic::Flipflop::KIND,
    crate::machine::Gantry::KIND,
    crate::spindle::Gearchange::KIND,
    crate::convert::Gray2bin::KIND,
    crate::counting::HandWheel::KIND,
    crate::arithmetic::Hypot::KIND,
    crate::filters::Ilowpass::KIND,
    crate::filters::Integ::KIND,
    crate::arithmetic::Invert::KIND,
    crate::machine::Joyhandle::KIND,
    crate::counting::Knob2float::KIND,
    crate::arithmetic::LedDim::KIND,
    crate::limits::Limit1::KIND,
    crate::limits::Limit2::KIND,
    crate::limits::Limit3::KIND,
    crate::arithmetic::Lincurve::KIND,
    crate::logic::Logic::KIND,
    crate::filters::Lowpass::KIND,
    crate::logic::Lut5::KIND,
    crate::logic::Maj3::KIND,
    crate::logic::Match8::KIND,
    crate::timing::Message::KIND,
    crate::filters::Minmax::KIND,
    crate::keys::Momentary2nist::KIND,
    crate::arithmetic::Mult2::KIND,
    crate::keys::Multiclick::KIND,
    crate::select::Multiswitch::KIND,
    crate::select::Mux16::KIND,
    crate::select::Mux2::KIND,
    crate::select::Mux4::KIND,
    crate::select::Mux8::KIND,
    crate::select::MuxGeneric::KIND,
    crate::compare::Near::KIND,
    crate::logic::Not::KIND,
    crate::arithmetic::Offset::KIND,
    crate::timing::Oneshot::KIND,
    crate::logic::Or2::KIND,
    crate::spindle::Orient::KIND,
    crate::pid::Pid::KIND,
    crate::filters::ProbeFilter::KIND,
    crate::safety::SafetyLatch::KIND,
    crate::logic::SampleHold::KIND,
    crate::arithmetic::Scale::KIND,
    crate::arithmetic::ScaledS32Sums::KIND,
    crate::select::Select8::KIND,
    crate::signals::Siggen::KIND,
    crate::counting::SimEncoder::KIND,
    crate::compare::SimHomeSwitch::KIND,
    crate::spindle::SimSpindle::KIND,
    crate::spindle::SpindleMonitor::KIND,
    crate::arithmetic::Sum2::KIND,
    crate::machine::ThermalCompensation::KIND,
    crate::timing::Time::KIND,
    crate::timing::Timedelay::KIND,
    crate::timing::Tof::KIND,
    crate::timing::Toggle::KIND,
    crate::keys::Toggle2nist::KIND,
    crate::timing::Ton::KIND,
    crate::logic::TristateBit::KIND,
    crate::logic::TristateFloat::KIND,
    crate::counting::Updown::KIND,
    crate::safety::Watchdog::KIND,
    crate::compare::Wcomp::KIND,
    crate::arithmetic::WeightedSum::KIND,
    crate::logic::Xor2::KIND,
];

/// The kind of that name, with `-` or `_`.
pub fn find(name: &str) -> Option<&'static Kind> {
    let name = name.replace('-', "_");
    kinds().find(|kind| kind.name == name)
}

/// Kinds from outside of this crate.
static OWN: OnceLock<&'static [Kind]> = OnceLock::new();

/// All kinds: those of the catalogue, then those that were registered.
pub fn kinds() -> impl Iterator<Item = &'static Kind> {
    let own: &[Kind] = OWN.get().copied().unwrap_or_default();
    CATALOGUE.iter().chain(own)
}

/// A kind that cannot be registered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RegisterError {
    /// Another one has its name.
    #[error("component {name:?}: there is one of this name")]
    Taken {
        /// The name.
        name: &'static str,
    },
    /// A name that no machine file could ask for.
    #[error("component {name:?}: a name has small letters, digits and `_`, a letter first")]
    Name {
        /// The name.
        name: &'static str,
    },
    /// Kinds were registered before.
    #[error("components are registered once, all of them together")]
    Again,
}

/// Adds kinds of a program that uses this crate, once, before machine files are read.
///
/// # Errors
/// Names that are taken or that machine files could not ask for; a second call.
pub fn register(own: &'static [Kind]) -> Result<(), RegisterError> {
    for (at, kind) in own.iter().enumerate() {
        let name = kind.name;
        let legal = |octet: u8| octet.is_ascii_lowercase() || octet.is_ascii_digit() || octet == b'_';
        if !name.starts_with(|first: char| first.is_ascii_lowercase()) || !name.bytes().all(legal) {
            return Err(RegisterError::Name { name });
        }
        if CATALOGUE.iter().chain(&own[..at]).any(|other| other.name == name) {
            return Err(RegisterError::Taken { name });
        }
    }
    OWN.set(own).map_err(|_| RegisterError::Again)
}
