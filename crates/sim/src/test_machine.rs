//! The machine of `configs/mill3-demo.toml` as it was when the tests of this module were written.

use config::*;
use motion::canon::{Axis, LengthUnit, Position};

pub(super) fn test_config() -> Config {
    let mapped = |index, sub, bits| Mapped { index, sub, bits };
    let node = |id: u8, name: &str, profile, device_type, outputs, inputs| Node {
        id,
        name: name.to_string(),
        profile,
        mandatory: true,
        pres_timeout_us: 150,
        identity: Identity {
            device_type: Some(device_type),
            ..Identity::default()
        },
        outputs,
        inputs,
        exchange: Exchange::Polled,
        software: None,
        pdo_version: 0,
        drive: None,
        device: None,
        writes: Vec::new(),
        cross: Vec::new(),
        channels: Vec::new(),
        ethercat: None,
    };
    let drive = |id, name| {
        let outputs = vec![
            mapped(0x6040, 0, 16),
            mapped(0x607A, 0, 32),
            mapped(0x6060, 0, 8),
            mapped(0x60FE, 1, 32),
        ];
        let inputs = vec![
            mapped(0x6041, 0, 16),
            mapped(0x6064, 0, 32),
            mapped(0x60F4, 0, 32),
            mapped(0x6061, 0, 8),
            mapped(0x60FD, 0, 32),
            mapped(0x603F, 0, 16),
        ];
        node(id, name, Profile::Cia402, 0x0002_0192, outputs, inputs)
    };
    let io_outputs = vec![mapped(0x6200, 1, 8), mapped(0x6200, 2, 8)];
    let io_inputs = vec![mapped(0x6000, 1, 8), mapped(0x6000, 2, 8)];
    let joint = |node, travel_mm, method, velocity_mm_s| Joint {
        step: None,
        analog: None,
        node,
        drive_axis: 0,
        mode: DriveMode::Csp,
        counts_per_unit: [10_000, 1],
        velocity_ratio: [1, 1],
        factor_group: FactorGroup::default(),
        torque_per_mm_s2: None,
        amplifier_lag_s: None,
        reactions: Reactions::default(),
        pid: None,
        switches: Switches::default(),
        home_count: 0,
        travel_mm,
        limits: JointLimits {
            velocity_mm_s,
            acceleration_mm_s2: 10.0 * velocity_mm_s,
            jerk_mm_s3: 200.0 * velocity_mm_s,
        },
        stop: StopLimits {
            acceleration_mm_s2: 20.0 * velocity_mm_s,
            jerk_mm_s3: 800.0 * velocity_mm_s,
        },
        following_error_mm: 2.0,
        homing: Homing {
            search_mm_s: 40.0,
            latch_mm_s: 4.0,
            position_mm: 0.0,
            sequence: None,
            absolute_encoder: false,
            moved_when_off_mm: 1.0,
            volatile: false,
            by: HomingBy::Drive {
                method,
                acceleration_mm_s2: 500.0,
            },
        },
        compensation: None,
        unhomed_jog_mm_s: 10.0,
        touch_probe: None,
        sto: None,
        squaring_offset_mm: 0.0,
    };
    Config {
        steps: None,
        path: "test.toml".into(),
        name: "mill3".to_string(),
        cycle_us: 1000,
        state_directory: None,
        probe_stops_jog: true,
        stops: Stops::default(),
        unit: LengthUnit::Millimetre,
        rt: Rt {
            phase_us: Some(370),
            keep_awake: Some(KeepAwake::None),
            calibrate: false,
            lock_memory: false,
            ..Rt::default()
        },
        bus: Bus {
            tap: None,
            kind: BusKind::Memory,
            interface: String::new(),
            link: BusLink::Raw,
            async_slot_timeout_us: 150,
            pres_lost_max: 3,
            soc_lost_max: Some(3),
            multiplex_cycles: 0,
            async_mtu: 1500,
            prescaler: 2,
            startup: None,
            clock: BusClock::Own,
            nodes: vec![
                drive(1, "x-drive"),
                drive(2, "y-drive"),
                drive(3, "z-drive"),
                node(10, "io", Profile::Io, 0x000F_0191, io_outputs, io_inputs),
            ],
        },
        transform: motion::kinematics::Transform::Trivial,
        joints: vec![
            joint(0, [-5.0, 305.0], 21, 150.0),
            joint(1, [-5.0, 205.0], 21, 150.0),
            joint(2, [-105.0, 5.0], 23, 100.0),
        ],
        axes: vec![
            AxisMap {
                axis: Axis::X,
                joints: vec![0],
                wrapped: false,
                travel_mm: None,
            },
            AxisMap {
                axis: Axis::Y,
                joints: vec![1],
                wrapped: false,
                travel_mm: None,
            },
            AxisMap {
                axis: Axis::Z,
                joints: vec![2],
                wrapped: false,
                travel_mm: None,
            },
        ],
        work_offsets: [Position::ZERO; 9],
        spindle: Spindle::default(),
        program: Program::default(),
        tools: Tools::default(),
        nets: Vec::new(),
        components: Vec::new(),
        logics: Vec::new(),
        external: Vec::new(),
        inputs: Vec::new(),
        sim: Sim {
            natural_frequency_hz: 60.0,
            damping: 0.8,
            start: 0.37,
            probe: None,
            faults: Vec::new(),
            joints: Vec::new(),
            signals: Vec::new(),
        },
        panel: None,
        cell: None,
    }
}
