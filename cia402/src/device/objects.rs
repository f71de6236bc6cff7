//! The drive's part of the object dictionary: 6000h to 67FFh.
//!
//! In:  nothing; a constant table for [`obd::Dictionary::new`].
//! Out: the lines, the keys under which the device finds its values, and the values that it refuses beyond plain ranges.

use super::homing;
use crate::profile::{axis_of, mode, object_of};
use obd::{AbortCode, DataType, Dictionary, EntryDef, Key};

/// 6502: all modes that have a meaning here.
pub const SUPPORTED_MODES: u32 = mode::supported_bit(mode::PROFILE_POSITION)
    | mode::supported_bit(mode::VELOCITY)
    | mode::supported_bit(mode::PROFILE_VELOCITY)
    | mode::supported_bit(mode::PROFILE_TORQUE)
    | mode::supported_bit(mode::HOMING)
    | mode::supported_bit(mode::INTERPOLATED_POSITION)
    | mode::supported_bit(mode::CYCLIC_SYNCHRONOUS_POSITION)
    | mode::supported_bit(mode::CYCLIC_SYNCHRONOUS_VELOCITY)
    | mode::supported_bit(mode::CYCLIC_SYNCHRONOUS_TORQUE);

/// 1000h of a servo drive: profile 402, servo.
pub const DEVICE_TYPE: u32 = 0x0002_0192;

const fn ro(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::ro(index, data_type, name)
}

const fn rw(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::rw(index, data_type, name)
}

/// One half of a ratio.
const fn ratio(index: u16, name: &'static str, sub: u8, default: i64) -> EntryDef {
    rw(index, DataType::U32, name)
        .sub(sub)
        .default(default)
        .limits(1, u32::MAX as i64)
}

/// Objects of a servo drive. Units: those of its factor group (608F to 6096), which is one to one as it comes: counts, counts/s,
/// counts/s².
///
/// Defaults that the profile leaves to the maker suit 10,000 counts per mm.
pub const DRIVE_OBJECTS: &[EntryDef] = &[
    rw(0x6007, DataType::I16, "Abort_connection_option_code")
        .default(1)
        .limits(0, 3),
    ro(0x603F, DataType::U16, "Error_code").tpdo(),
    rw(0x6040, DataType::U16, "Controlword").rpdo(),
    ro(0x6041, DataType::U16, "Statusword").tpdo(),
    rw(0x6042, DataType::I16, "vl_target_velocity").rpdo(),
    ro(0x6043, DataType::I16, "vl_velocity_demand").tpdo(),
    ro(0x6044, DataType::I16, "vl_velocity_actual_value").tpdo(),
    rw(0x6046, DataType::U32, "vl_velocity_min_max_amount").sub(1).rpdo(),
    rw(0x6046, DataType::U32, "vl_velocity_min_max_amount")
        .sub(2)
        .default(6000)
        .rpdo(),
    rw(0x6048, DataType::U32, "vl_velocity_acceleration")
        .sub(1)
        .default(3000)
        .rpdo(),
    rw(0x6048, DataType::U16, "vl_velocity_acceleration")
        .sub(2)
        .default(1)
        .rpdo(),
    rw(0x6049, DataType::U32, "vl_velocity_deceleration")
        .sub(1)
        .default(3000)
        .rpdo(),
    rw(0x6049, DataType::U16, "vl_velocity_deceleration")
        .sub(2)
        .default(1)
        .rpdo(),
    rw(0x605A, DataType::I16, "Quick_stop_option_code")
        .default(2)
        .limits(0, 6),
    rw(0x605B, DataType::I16, "Shutdown_option_code")
        .default(0)
        .limits(0, 1),
    rw(0x605C, DataType::I16, "Disable_operation_option_code")
        .default(1)
        .limits(0, 1),
    rw(0x605D, DataType::I16, "Halt_option_code").default(1).limits(1, 2),
    rw(0x605E, DataType::I16, "Fault_reaction_option_code")
        .default(2)
        .limits(0, 2),
    rw(0x6060, DataType::I8, "Modes_of_operation").rpdo(),
    ro(0x6061, DataType::I8, "Modes_of_operation_display").tpdo(),
    ro(0x6062, DataType::I32, "Position_demand_value").tpdo(),
    ro(0x6063, DataType::I32, "Position_actual_internal_value").tpdo(),
    ro(0x6064, DataType::I32, "Position_actual_value").tpdo(),
    rw(0x6065, DataType::U32, "Following_error_window")
        .default(0xFFFF_FFFF)
        .rpdo(),
    rw(0x6066, DataType::U16, "Following_error_time_out").default(10).rpdo(),
    rw(0x6067, DataType::U32, "Position_window").default(10).rpdo(),
    rw(0x6068, DataType::U16, "Position_window_time").rpdo(),
    ro(0x606B, DataType::I32, "Velocity_demand_value").tpdo(),
    ro(0x606C, DataType::I32, "Velocity_actual_value").tpdo(),
    rw(0x606D, DataType::U16, "Velocity_window").default(1000).rpdo(),
    rw(0x606E, DataType::U16, "Velocity_window_time").rpdo(),
    rw(0x606F, DataType::U16, "Velocity_threshold").default(100).rpdo(),
    rw(0x6070, DataType::U16, "Velocity_threshold_time").rpdo(),
    rw(0x6071, DataType::I16, "Target_torque").rpdo(),
    rw(0x6072, DataType::U16, "Max_torque").default(3000).rpdo(),
    ro(0x6074, DataType::I16, "Torque_demand").tpdo(),
    ro(0x6077, DataType::I16, "Torque_actual_value").tpdo(),
    rw(0x607A, DataType::I32, "Target_position").rpdo(),
    rw(0x607C, DataType::I32, "Home_offset").rpdo(),
    rw(0x607D, DataType::I32, "Software_position_limit")
        .sub(1)
        .default(i32::MIN as i64)
        .rpdo(),
    rw(0x607D, DataType::I32, "Software_position_limit")
        .sub(2)
        .default(i32::MAX as i64)
        .rpdo(),
    rw(0x607F, DataType::U32, "Max_profile_velocity")
        .default(i32::MAX as i64)
        .rpdo(),
    rw(0x6080, DataType::U32, "Max_motor_speed").default(100_000).rpdo(),
    rw(0x6081, DataType::U32, "Profile_velocity").default(100_000).rpdo(),
    rw(0x6083, DataType::U32, "Profile_acceleration")
        .default(10_000_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x6084, DataType::U32, "Profile_deceleration")
        .default(10_000_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x6085, DataType::U32, "Quick_stop_deceleration")
        .default(30_000_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x6087, DataType::U32, "Torque_slope").default(10_000).rpdo(),
    ratio(0x608F, "Position_encoder_resolution", 1, 10_000),
    ratio(0x608F, "Position_encoder_resolution", 2, 1),
    rw(0x6090, DataType::U32, "Velocity_encoder_resolution").sub(1),
    rw(0x6090, DataType::U32, "Velocity_encoder_resolution")
        .sub(2)
        .default(1)
        .limits(1, u32::MAX as i64),
    ratio(0x6091, "Gear_ratio", 1, 1),
    ratio(0x6091, "Gear_ratio", 2, 1),
    ratio(0x6092, "Feed_constant", 1, 10_000),
    ratio(0x6092, "Feed_constant", 2, 1),
    ratio(0x6096, "Velocity_factor", 1, 1),
    ratio(0x6096, "Velocity_factor", 2, 1),
    rw(0x6098, DataType::I8, "Homing_method").default(37).rpdo(),
    rw(0x6099, DataType::U32, "Homing_speeds")
        .sub(1)
        .default(200_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x6099, DataType::U32, "Homing_speeds")
        .sub(2)
        .default(20_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x609A, DataType::U32, "Homing_acceleration")
        .default(5_000_000)
        .limits(1, u32::MAX as i64)
        .rpdo(),
    rw(0x60B1, DataType::I32, "Velocity_offset").rpdo(),
    rw(0x60B2, DataType::I16, "Torque_offset").rpdo(),
    rw(0x60B8, DataType::U16, "Touch_probe_function").rpdo(),
    ro(0x60B9, DataType::U16, "Touch_probe_status").tpdo(),
    ro(0x60BA, DataType::I32, "Touch_probe_1_positive_edge").tpdo(),
    ro(0x60BB, DataType::I32, "Touch_probe_1_negative_edge").tpdo(),
    ro(0x60BC, DataType::I32, "Touch_probe_2_positive_edge").tpdo(),
    ro(0x60BD, DataType::I32, "Touch_probe_2_negative_edge").tpdo(),
    rw(0x60C0, DataType::I16, "Interpolation_sub_mode_select").limits(0, 0),
    rw(0x60C1, DataType::I32, "Interpolation_data_record").sub(1).rpdo(),
    rw(0x60C2, DataType::U8, "Interpolation_time_period")
        .sub(1)
        .default(1)
        .limits(1, 255),
    rw(0x60C2, DataType::I8, "Interpolation_time_period")
        .sub(2)
        .default(-3)
        .limits(-6, 0),
    ro(0x60F4, DataType::I32, "Following_error_actual_value").tpdo(),
    ro(0x60FC, DataType::I32, "Position_demand_internal_value").tpdo(),
    ro(0x60FD, DataType::U32, "Digital_inputs").tpdo(),
    rw(0x60FE, DataType::U32, "Digital_outputs").sub(1).rpdo(),
    rw(0x60FE, DataType::U32, "Digital_outputs").sub(2).rpdo(),
    rw(0x60FF, DataType::I32, "Target_velocity").rpdo(),
    EntryDef::constant(0x6502, DataType::U32, "Supported_drive_modes").default(SUPPORTED_MODES as i64),
    EntryDef::constant(0x67FF, DataType::U32, "Single_device_type").default(DEVICE_TYPE as i64),
];

/// As [`DRIVE_OBJECTS`], of a drive that takes its target in 6062: there the position demand can be written and mapped as such.
pub const DRIVE_OBJECTS_WITH_DEMAND: &[EntryDef] = &with_demand();

const fn with_demand() -> [EntryDef; DRIVE_OBJECTS.len()] {
    let mut table = [DRIVE_OBJECTS[0]; DRIVE_OBJECTS.len()];
    let mut line = 0;
    while line < table.len() {
        table[line] = match DRIVE_OBJECTS[line].index {
            0x6062 => rw(0x6062, DataType::I32, "Position_demand_value").rpdo(),
            _ => DRIVE_OBJECTS[line],
        };
        line += 1;
    }
    table
}

/// Whether the drive takes a value written by SDO that the table's own checks let pass: modes it does not have (6502), homing
/// methods and option codes it does not know are [`AbortCode::VALUE_RANGE`].
///
/// # Errors
/// [`AbortCode::VALUE_RANGE`].
pub fn check_write<const ENTRIES: usize, const BYTES: usize>(
    objects: &Dictionary<ENTRIES, BYTES>,
    index: u16,
    sub: u8,
    value: &[u8],
) -> Result<(), AbortCode> {
    let (axis, index) = axis_of(index);
    let supported = objects
        .key(object_of(axis, 0x6502), 0)
        .map_or(SUPPORTED_MODES, |key| objects.get(key));
    let allowed = match (index, sub, value) {
        (0x6060, 0, &[code]) => code as i8 == mode::NONE || supported & mode::supported_bit(code as i8) != 0,
        (0x6098, 0, &[method]) => homing::Method::from_number(method as i8).is_some(),
        // Stops at the current limit and the voltage limit need a motor that has them.
        (0x605A, 0, &[low, high]) => matches!(i16::from_le_bytes([low, high]), 0 | 1 | 2 | 5 | 6),
        _ => true,
    };
    if allowed { Ok(()) } else { Err(AbortCode::VALUE_RANGE) }
}

/// Declares the keys and finds them in one place.
macro_rules! keys {
    ($($name:ident: $type:ty = $index:literal / $sub:literal;)*) => {
        /// Where the device's values lie.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Keys {
            $(pub(super) $name: Key<$type>,)*
        }

        impl Keys {
            pub(super) fn find<const ENTRIES: usize, const BYTES: usize>(
                objects: &Dictionary<ENTRIES, BYTES>,
                axis: u8,
            ) -> Result<Keys, AbortCode> {
                Ok(Keys { $($name: objects.key(object_of(axis, $index), $sub)?,)* })
            }
        }
    };
}

keys! {
    abort_connection: i16 = 0x6007 / 0;
    error_code: u16 = 0x603F / 0;
    controlword: u16 = 0x6040 / 0;
    statusword: u16 = 0x6041 / 0;
    vl_target: i16 = 0x6042 / 0;
    vl_demand: i16 = 0x6043 / 0;
    vl_actual: i16 = 0x6044 / 0;
    vl_least: u32 = 0x6046 / 1;
    vl_most: u32 = 0x6046 / 2;
    vl_acceleration_speed: u32 = 0x6048 / 1;
    vl_acceleration_time: u16 = 0x6048 / 2;
    vl_deceleration_speed: u32 = 0x6049 / 1;
    vl_deceleration_time: u16 = 0x6049 / 2;
    quick_stop_option: i16 = 0x605A / 0;
    shutdown_option: i16 = 0x605B / 0;
    disable_option: i16 = 0x605C / 0;
    halt_option: i16 = 0x605D / 0;
    fault_option: i16 = 0x605E / 0;
    mode: i8 = 0x6060 / 0;
    mode_display: i8 = 0x6061 / 0;
    position_demand: i32 = 0x6062 / 0;
    position_internal: i32 = 0x6063 / 0;
    position: i32 = 0x6064 / 0;
    following_window: u32 = 0x6065 / 0;
    following_time_ms: u16 = 0x6066 / 0;
    position_window: u32 = 0x6067 / 0;
    position_window_ms: u16 = 0x6068 / 0;
    velocity_demand: i32 = 0x606B / 0;
    velocity: i32 = 0x606C / 0;
    velocity_window: u16 = 0x606D / 0;
    velocity_window_ms: u16 = 0x606E / 0;
    standstill: u16 = 0x606F / 0;
    standstill_ms: u16 = 0x6070 / 0;
    target_torque: i16 = 0x6071 / 0;
    torque_max: u16 = 0x6072 / 0;
    torque_demand: i16 = 0x6074 / 0;
    torque: i16 = 0x6077 / 0;
    target: i32 = 0x607A / 0;
    home_offset: i32 = 0x607C / 0;
    limit_low: i32 = 0x607D / 1;
    limit_high: i32 = 0x607D / 2;
    profile_velocity_max: u32 = 0x607F / 0;
    motor_speed_max: u32 = 0x6080 / 0;
    profile_velocity: u32 = 0x6081 / 0;
    acceleration: u32 = 0x6083 / 0;
    deceleration: u32 = 0x6084 / 0;
    quick_deceleration: u32 = 0x6085 / 0;
    torque_slope: u32 = 0x6087 / 0;
    encoder_increments: u32 = 0x608F / 1;
    encoder_revolutions: u32 = 0x608F / 2;
    velocity_encoder_increments: u32 = 0x6090 / 1;
    velocity_encoder_revolutions: u32 = 0x6090 / 2;
    gear_motor: u32 = 0x6091 / 1;
    gear_shaft: u32 = 0x6091 / 2;
    feed_units: u32 = 0x6092 / 1;
    feed_shaft: u32 = 0x6092 / 2;
    velocity_numerator: u32 = 0x6096 / 1;
    velocity_divisor: u32 = 0x6096 / 2;
    homing_method: i8 = 0x6098 / 0;
    homing_search: u32 = 0x6099 / 1;
    homing_latch: u32 = 0x6099 / 2;
    homing_acceleration: u32 = 0x609A / 0;
    velocity_offset: i32 = 0x60B1 / 0;
    torque_offset: i16 = 0x60B2 / 0;
    probe_function: u16 = 0x60B8 / 0;
    probe_status: u16 = 0x60B9 / 0;
    probe_1_rising: i32 = 0x60BA / 0;
    probe_1_falling: i32 = 0x60BB / 0;
    probe_2_rising: i32 = 0x60BC / 0;
    probe_2_falling: i32 = 0x60BD / 0;
    interpolation_target: i32 = 0x60C1 / 1;
    interpolation_digits: u8 = 0x60C2 / 1;
    interpolation_power: i8 = 0x60C2 / 2;
    following_error: i32 = 0x60F4 / 0;
    position_demand_internal: i32 = 0x60FC / 0;
    digital_inputs: u32 = 0x60FD / 0;
    outputs: u32 = 0x60FE / 1;
    outputs_mask: u32 = 0x60FE / 2;
    target_velocity: i32 = 0x60FF / 0;
    supported_modes: u32 = 0x6502 / 0;
}
