//! Parameters that tell something of the state and that a program cannot set; their values are in `state`.

/// Names of all predefined parameters but those of INI files and pins.
pub(super) const NAMES: &[&str] = &[
    "_vmajor",
    "_vminor",
    "_line",
    "_motion_mode",
    "_plane",
    "_ccomp",
    "_metric",
    "_imperial",
    "_metric_machine",
    "_absolute",
    "_incremental",
    "_inverse_time",
    "_units_per_minute",
    "_units_per_rev",
    "_coord_system",
    "_tool_offset",
    "_retract_r_plane",
    "_retract_old_z",
    "_spindle_rpm_mode",
    "_spindle_css_mode",
    "_ijk_absolute_mode",
    "_lathe_diameter_mode",
    "_lathe_radius_mode",
    "_spindle_on",
    "_spindle_cw",
    "_mist",
    "_flood",
    "_speed_override",
    "_feed_override",
    "_adaptive_feed",
    "_feed_hold",
    "_feed",
    "_rpm",
    "_x",
    "_y",
    "_z",
    "_a",
    "_b",
    "_c",
    "_u",
    "_v",
    "_w",
    "_abs_x",
    "_abs_y",
    "_abs_z",
    "_abs_a",
    "_abs_b",
    "_abs_c",
    "_abs_u",
    "_abs_v",
    "_abs_w",
    "_current_tool",
    "_current_pocket",
    "_selected_tool",
    "_selected_pocket",
    "_value",
    "_value_returned",
    "_task",
    "_call_level",
    "_remap_level",
];

/// Whether a program cannot assign to a named parameter.
pub(crate) fn is_read_only(name: &str) -> bool {
    NAMES.contains(&name) || name.starts_with("_ini[") || name.starts_with("_hal[")
}

/// Whether a program cannot assign to a numbered parameter.
pub(crate) fn is_read_only_number(index: u32) -> bool {
    matches!(index, 5021..=5029 | 5081..=5089 | 5400..=5413 | 5420..=5428)
}
