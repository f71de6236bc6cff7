//! What the machine knows again after a restart: kept while it runs, written by a thread of its own.
//!
//! In:  what the cycle thread shows, what programs and clients do. Out: `state.json` of the state folder; homed marks of joints
//! whose encoder is absolute, as far as they can be believed.
//!
//! A homed mark of an earlier session is believed where the encoder is absolute, the drive counts about what it counted when it was
//! last seen, and the machine file says the same of the joint as then. Whatever is not believed is told with its reason, and homed
//! as ever.

use crate::console::Operator;
use crate::program_reports::{self, Reports, StandByReport};
use config::{Config, HomingBy};
use host::capabilities;
use host::capabilities::Work;
use machine::safe_file::Disk;
use machine::state::State;
use machine::state_file::{self, LastProgram, MDI_MAX, Parts, Place, Remembered};
use protocol::{LastResult, Outcome};
use rt::shared::{Command, DrivePlace};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Places of joints, and the line of a program, are written no more often, ns.
const WRITTEN_NS: u64 = 1_000_000_000;
/// Moves below this are none, mm.
const REST_MM: f64 = 1e-3;
/// Farther than any joint goes, mm.
const FARTHEST_MM: f64 = 1e7;
/// What waits at the most for a disk that takes nothing.
const UNWRITTEN_MAX: usize = 100;
/// A disk that takes nothing is asked again after this long.
const RETRY: Duration = Duration::from_secs(1);

/// What is to be written.
#[derive(Debug, PartialEq)]
enum Paper {
    State(Remembered),
    Report(StandByReport),
}

/// The same, and its number.
type Version = (u64, Paper);

/// The operator's ends of the way to the disk.
#[derive(Debug)]
struct ToDisk {
    versions: Sender<Version>,
    /// Number of a version that is on the disk, or why it is not.
    written: Receiver<(u64, Result<(), String>)>,
}

/// The ends of the thread that writes.
#[derive(Debug)]
pub(super) struct Writer {
    versions: Receiver<Version>,
    written: Sender<(u64, Result<(), String>)>,
}

/// What is known, and the way to the disk.
#[derive(Debug)]
pub(super) struct Memory<'env> {
    config: &'env Config,
    now: Remembered,
    /// What was handed to the thread that writes last.
    handed: Remembered,
    disk: Option<ToDisk>,
    /// Number of the last version that was handed over, and of the last one that was treated.
    versions: [u64; 2],
    /// Why the last version is not on the disk.
    failed: Option<String>,
    /// Joints whose homed mark has yet to be judged, and those that were told it (bit n: joint n).
    pending: u64,
    told: u64,
    reports: Reports,
    /// When places and lines were last taken.
    taken_ns: u64,
}

impl<'env> Memory<'env> {
    /// Of a machine, whose file remembers this.
    pub(super) fn new(config: &'env Config, remembered: Remembered) -> Memory<'env> {
        let handed = remembered.clone();
        let mut now = remembered;
        now.joints.resize_with(config.joints.len(), Place::default);
        let gone = now.mdi.len().saturating_sub(MDI_MAX);
        now.mdi.drain(..gone);
        if let Some(program) = &mut now.program {
            program.result.get_or_insert(LastResult::Interrupted);
        }
        let mut pending = 0;
        for (joint, (place, of)) in now.joints.iter_mut().zip(&config.joints).enumerate() {
            // Drives without an absolute encoder count anew from power-on on.
            place.homed &= of.homing.absolute_encoder;
            pending |= u64::from(place.homed) << joint;
        }
        Memory {
            config,
            now,
            handed,
            disk: None,
            versions: [0; 2],
            failed: None,
            pending,
            told: 0,
            reports: Reports::default(),
            taken_ns: 0,
        }
    }

    /// Writes changes to the disk from now on, by a thread that runs [`write`] with what is given back.
    pub(super) fn kept_on_disk(&mut self, folder: &Path) -> Writer {
        self.reports = Reports::read(folder);
        let (versions, versions_out) = channel();
        let (written_in, written) = channel();
        self.disk = Some(ToDisk { versions, written });
        Writer {
            versions: versions_out,
            written: written_in,
        }
    }

    /// What is remembered.
    pub(super) fn now(&self) -> &Remembered {
        &self.now
    }

    /// Number of the version that will hold all that is noted up to now.
    pub(super) fn mark(&self) -> u64 {
        self.versions[0] + u64::from(self.disk.is_some() && self.now != self.handed)
    }

    /// Whether a version has been written, or cannot be.
    pub(super) fn is_settled(&self, mark: u64) -> bool {
        self.versions[1] >= mark
    }

    /// Why what was noted last is not on the disk.
    pub(super) fn failure(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// A line was typed.
    pub(super) fn add_mdi(&mut self, line: &str) {
        if self.now.mdi.last().is_some_and(|last| last == line) {
            return;
        }
        self.now.mdi.push(line.to_owned());
        let gone = self.now.mdi.len().saturating_sub(MDI_MAX);
        self.now.mdi.drain(..gone);
    }

    /// A program was loaded.
    pub(super) fn load_program(&mut self, name: &str) {
        self.now.program = Some(LastProgram {
            name: name.to_owned(),
            line: 0,
            result: Some(LastResult::Loaded),
        });
    }

    /// A program begins.
    pub(super) fn begin_program(&mut self, name: &str) {
        self.now.program = Some(LastProgram {
            name: name.to_owned(),
            line: 0,
            result: None,
        });
    }

    /// It is over; `is_part`: it came to its end.
    pub(super) fn end_program(&mut self, result: Outcome, is_part: bool, line: u32) {
        if let Some(program) = &mut self.now.program {
            program.result = Some(result.into());
            program.line = line;
        }
        self.now.parts.count = self.now.parts.count.saturating_add(u64::from(is_part));
    }

    /// Keeps the report of a program; `make` gives it for its number.
    pub(super) fn add_report(&mut self, make: impl FnOnce(u64, Parts) -> StandByReport) -> u64 {
        let number = self.reports.next_number(self.now.programs);
        self.now.programs = number;
        let report = self.reports.add(make(number, self.now.parts));
        self.send(Paper::Report(report));
        number
    }

    /// Reports of programs.
    pub(super) fn reports(&self) -> &Reports {
        &self.reports
    }

    /// Sets the counter of parts, or how many are wanted.
    pub(super) fn set_parts(&mut self, parts: Parts) {
        self.now.parts = parts;
    }

    /// Takes in how things are, and has it written where it has changed. Waits for nothing. `tool`: in the spindle as far as the
    /// tables know.
    pub(super) fn look(&mut self, operator: &mut Operator, tool: u32, now_ns: u64) {
        self.hear(operator);
        self.judge(operator);
        self.take(operator, now_ns);
        self.now.tool = operator.tool().unwrap_or(tool);
        self.now.changing = operator.changing_tool();
        self.hand_over();
    }

    /// Called when all is over: what is known last goes to the disk, and its thread ends.
    pub(super) fn finish(&mut self, operator: &mut Operator) {
        let shared = operator.shared();
        for joint in 0..self.now.joints.len() {
            if let Some(place) = shared.place(joint)
                && self.now.joints[joint].homed
                // Of one that nobody has judged, what the file says holds on.
                && (self.pending | self.told) >> joint & 1 == 0
            {
                self.now.joints[joint] = self.place(joint, true, &place);
            }
        }
        self.hand_over();
        if let Some(disk) = self.disk.take() {
            drop(disk.versions);
            while let Ok((_, written)) = disk.written.recv() {
                self.failed = written.err();
            }
            if let Some(why) = self.failed.take() {
                operator.add_warning(format!("not kept: {why}"));
            }
        }
    }

    fn hand_over(&mut self) {
        if self.disk.is_some() && self.now != self.handed {
            self.handed.clone_from(&self.now);
            self.send(Paper::State(self.now.clone()));
        }
    }

    fn send(&mut self, paper: Paper) {
        if let Some(disk) = &self.disk {
            self.versions[0] += 1;
            // A thread that is gone has panicked, which its end tells.
            let _ = disk.versions.send((self.versions[0], paper));
        }
    }

    /// Takes in what came of writing.
    fn hear(&mut self, operator: &mut Operator) {
        let Some(disk) = &self.disk else {
            return;
        };
        while let Ok((number, written)) = disk.written.try_recv() {
            self.versions[1] = self.versions[1].max(number);
            match written {
                Ok(()) => self.failed = None,
                Err(why) => {
                    if self.failed.is_none() {
                        operator.add_warning(format!(
                            "not kept: {why}; the machine remembers until this process ends"
                        ));
                    }
                    self.failed = Some(why);
                }
            }
        }
    }

    /// Believes homed marks of an earlier session, or says why not.
    fn judge(&mut self, operator: &mut Operator) {
        let live = operator.live();
        if live.state != State::Disabled || !operator.is_up_to_date() {
            return;
        }
        let shared = operator.shared();
        for joint in 0..self.now.joints.len() {
            let bit = 1 << joint;
            let Some(place) = shared.place(joint).filter(|place| place.online) else {
                continue;
            };
            if self.told & bit != 0 {
                self.told &= !bit;
                if live.homed & bit != 0 {
                    let motor_mm = self.place(joint, true, &place).motor_mm;
                    operator.add_entry(format!(
                        "{}: homed, as its absolute encoder says: at {motor_mm:.3}",
                        operator.joint_name(joint)
                    ));
                } else {
                    // The machine was doing something else.
                    self.pending |= bit;
                }
            } else if self.pending & bit != 0 {
                self.pending &= !bit;
                match self.zero_mm(joint, &place) {
                    Ok(zero_mm) => {
                        operator.give(Command::TakeHome { joint, zero_mm });
                        self.told |= bit;
                    }
                    Err(why) => {
                        self.now.joints[joint].homed = false;
                        let joint = operator.joint_name(joint).to_owned();
                        operator.add_warning(format!("{joint}: to be homed: {why}"));
                    }
                }
            }
        }
    }

    /// Position at which the drive counts 0, as it was in the earlier session; or why that is not to be believed.
    fn zero_mm(&self, joint: usize, now: &DrivePlace) -> Result<f64, String> {
        let (before, of) = (&self.now.joints[joint], &self.config.joints[joint]);
        let counts_per_mm = self.counts_per_mm(joint);
        if before.counts_per_mm != counts_per_mm {
            return Err("counts_per_unit of the machine file is another one than then".into());
        }
        if before.motor_mm.abs() > FARTHEST_MM {
            return Err(format!("nothing stands at {} mm", before.motor_mm));
        }
        let moved_mm = f64::from((now.counts as i32).wrapping_sub(before.counts)) / counts_per_mm;
        let allowed_mm = of.homing.moved_when_off_mm;
        if moved_mm.abs() > allowed_mm {
            return Err(format!(
                "its drive counts {moved_mm:.3} mm from where it was last seen, more than moved_when_off_mm allows, {allowed_mm}"
            ));
        }
        let zero_mm = before.motor_mm + moved_mm - now.counts as f64 / counts_per_mm;
        if let HomingBy::Drive { .. } = of.homing.by
            && (zero_mm - of.homing.position_mm).abs() > 0.5 / counts_per_mm
        {
            return Err("position_mm of the machine file is another one than then".into());
        }
        Ok(zero_mm)
    }

    /// Takes places of joints that rest, and the line of a program.
    fn take(&mut self, operator: &Operator, now_ns: u64) {
        let live = operator.live();
        let shared = operator.shared();
        let is_due = now_ns.saturating_sub(self.taken_ns) >= WRITTEN_NS;
        if is_due {
            self.taken_ns = now_ns;
        }
        if let Some(program) = self.now.program.as_mut().filter(|program| program.result.is_none())
            && matches!(live.state, State::Running | State::Held | State::Stopping)
            && (is_due || live.state == State::Held)
        {
            program.line = live.line;
        }
        let rests = matches!(
            live.state,
            State::Disabled | State::Ready | State::Held | State::Faulted | State::Estop
        );
        if !rests || !operator.is_up_to_date() {
            return;
        }
        for joint in 0..self.now.joints.len() {
            let bit = 1 << joint;
            let Some(place) = shared.place(joint) else {
                continue;
            };
            if !place.online {
                // An absolute encoder knows its place still when it is back.
                if self.now.joints[joint].homed {
                    self.pending |= bit;
                    self.told &= !bit;
                }
                continue;
            }
            // Homed anew before it was judged.
            if live.homed & bit != 0 && live.state != State::Disabled {
                self.told &= !bit;
                self.pending &= !bit;
            }
            if (self.pending | self.told) & bit != 0 {
                continue;
            }
            let is_homed = live.homed & bit != 0 && self.config.joints[joint].homing.absolute_encoder;
            let fresh = self.place(joint, is_homed, &place);
            let before = &mut self.now.joints[joint];
            let has_moved = (fresh.motor_mm - before.motor_mm).abs() > REST_MM;
            if fresh.homed != before.homed || has_moved && is_due {
                *before = fresh;
            }
        }
    }

    fn place(&self, joint: usize, homed: bool, place: &DrivePlace) -> Place {
        let counts_per_mm = self.counts_per_mm(joint);
        Place {
            homed,
            motor_mm: place.counts as f64 / counts_per_mm + place.zero_mm,
            // What the drive sends has 32 bits.
            counts: place.counts as i32,
            counts_per_mm,
        }
    }

    fn counts_per_mm(&self, joint: usize) -> f64 {
        let [counts, units] = self.config.joints[joint].counts_per_unit.map(f64::from);
        counts / units
    }
}

/// Writes reports, and the latest state, to the state folder until nobody sends any more.
pub(super) fn write(folder: &Path, writer: &Writer) {
    capabilities::give_up_or_warn(Work::Closing);
    let mut unwritten: Vec<Version> = Vec::new();
    loop {
        let next = match unwritten.is_empty() {
            false => writer.versions.recv_timeout(RETRY),
            true => writer.versions.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let is_over = next == Err(RecvTimeoutError::Disconnected);
        for (number, paper) in next.into_iter().chain(writer.versions.try_iter()) {
            if matches!(paper, Paper::State(_)) {
                unwritten.retain(|(_, paper)| matches!(paper, Paper::Report(_)));
            }
            unwritten.push((number, paper));
            // A disk that takes nothing for long: the oldest report goes.
            if unwritten.len() > UNWRITTEN_MAX {
                unwritten.remove(0);
            }
        }
        if let Some((last, _)) = unwritten.last() {
            let (last, mut failed) = (*last, None);
            unwritten.retain(|(_, paper)| match save(folder, paper) {
                Ok(()) => false,
                Err(cause) => {
                    failed = Some(format!("{}: {cause}", folder.display()));
                    true
                }
            });
            // Nobody hears it any more where the session is over.
            let _ = writer.written.send((last, failed.map_or(Ok(()), Err)));
        }
        if is_over {
            return;
        }
    }
}

/// In a thread that has the right to files for this long only.
fn save(folder: &Path, paper: &Paper) -> Result<(), String> {
    let work = || {
        capabilities::use_files().map_err(|cause| cause.to_string())?;
        let saved = match paper {
            Paper::State(remembered) => state_file::save(&mut Disk, folder, remembered),
            Paper::Report(report) => program_reports::save(folder, report),
        };
        saved.map_err(|cause| cause.to_string())
    };
    let ended = std::thread::scope(|scope| scope.spawn(work).join());
    ended.unwrap_or_else(|_| Err("the thread that writes it panicked".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rehearsal::{Rehearsal, rehearse_with};
    use config::Homing;
    use machine::sequence::{Job, Step};
    use sim::NetConfig;

    fn machine(change: impl Fn(&mut Homing)) -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
        config.joints.iter_mut().for_each(|joint| change(&mut joint.homing));
        config
    }

    fn absolute(homing: &mut Homing) {
        homing.absolute_encoder = true;
    }

    fn usual(_: &mut Homing) {}

    /// The network is up, drives off.
    fn stand_by(config: &Config, act: impl FnOnce(&mut Rehearsal<'_>)) {
        let net = NetConfig::clean(1);
        rehearse_with(config, b"M2\n", net, Operator::standing_by, |run| {
            assert!(run.run_until(60_000, |run| run.control.state() == State::Disabled)?);
            // What is told of that has been read.
            run.run_until(20, |_| false)?;
            act(run);
            Ok(())
        })
        .unwrap();
    }

    fn look(run: &mut Rehearsal<'_>, memory: &mut Memory<'_>) {
        for _ in 0..4 {
            let now_ns = run.now_ns();
            memory.look(&mut run.operator, 0, now_ns);
            run.run_until(20, |_| false).unwrap();
        }
    }

    fn do_job(run: &mut Rehearsal<'_>, job: Job) {
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, job));
        let done = run.run_until(60_000, |run| {
            run.operator.step() == Step::StandBy && run.control.state() == State::Ready
        });
        assert!(done.unwrap());
    }

    fn switch_off(run: &mut Rehearsal<'_>) {
        let now_ns = run.now_ns();
        run.operator.off(now_ns);
        let off = run.run_until(60_000, |run| run.control.state() == State::Disabled);
        assert!(off.unwrap());
    }

    /// The simulated drives count 0 at power-on, as they did when these joints were last seen: homed, at the home point.
    fn at_home() -> Remembered {
        let place = Place {
            homed: true,
            motor_mm: 0.0,
            counts: 0,
            counts_per_mm: 10_000.0,
        };
        Remembered {
            joints: vec![place; 3],
            ..Remembered::default()
        }
    }

    /// What is told of joints, and which of them are homed, behind a restart with this file.
    fn restarted(homing: fn(&mut Homing), remembered: Remembered) -> (Vec<String>, u64) {
        let config = machine(homing);
        let mut found = None;
        stand_by(&config, |run| {
            let before = run.operator.journal().len();
            let mut memory = Memory::new(&config, remembered);
            look(run, &mut memory);
            let told = run.operator.journal()[before..].iter().map(|entry| entry.text.clone());
            let homed = run.operator.live().homed;
            assert!((0..3).all(|joint| memory.now().joints[joint].homed == (homed >> joint & 1 == 1)));
            found = Some((told.collect(), homed));
        });
        found.expect("it ran")
    }

    #[test]
    fn joints_with_absolute_encoders_are_homed_behind_a_restart_and_run() {
        let (told, homed) = restarted(absolute, at_home());
        assert_eq!(homed, 0b111);
        assert_eq!(
            told[0],
            "axis X (joint 0): homed, as its absolute encoder says: at 0.000"
        );
        assert_eq!(told.len(), 3, "{told:?}");
        // Where they stand counts, and drives on move nothing.
        let config = machine(absolute);
        stand_by(&config, |run| {
            let mut remembered = at_home();
            remembered.joints[1].counts = 3_000;
            remembered.joints[1].motor_mm = 0.3;
            let mut memory = Memory::new(&config, remembered);
            look(run, &mut memory);
            do_job(run, Job::On);
            let live = run.operator.live();
            assert_eq!((live.homed, live.position.0[..3].to_vec()), (0b111, vec![0.0; 3]));
            // It is remembered where it stands.
            run.run_until(1_100, |_| false).unwrap();
            look(run, &mut memory);
            assert_eq!(memory.now().joints, at_home().joints);
        });
    }

    #[test]
    fn a_mark_is_not_believed_where_the_joint_or_the_machine_file_has_changed() {
        let changed = |change: fn(&mut Place)| {
            let mut remembered = at_home();
            change(&mut remembered.joints[1]);
            let (told, homed) = restarted(absolute, remembered);
            assert_eq!(homed, 0b101, "{told:?}");
            told.into_iter()
                .find(|told| told.starts_with("warning: "))
                .expect("a warning")
        };
        assert_eq!(
            changed(|place| place.counts = -10_001),
            "warning: axis Y (joint 1): to be homed: its drive counts 1.000 mm from where it was last seen, more than \
             moved_when_off_mm allows, 1"
        );
        let said = changed(|place| place.counts_per_mm = 5_000.0);
        assert!(
            said.contains("counts_per_unit of the machine file is another one"),
            "{said}"
        );
        let said = changed(|place| place.motor_mm = 1e300);
        assert!(said.contains("nothing stands at 1000000"), "{said}");
        let said = changed(|place| place.motor_mm = 3.0);
        assert!(
            said.contains("position_mm of the machine file is another one"),
            "{said}"
        );
    }

    /// A single run does not wait: its drives go on as soon as they are there, and its joints are homed by its sequence.
    #[test]
    fn a_mark_that_nobody_could_judge_stays_as_it_was() {
        let config = machine(absolute);
        stand_by(&config, |run| {
            let mut remembered = at_home();
            remembered.joints.iter_mut().for_each(|place| place.motor_mm = 77.0);
            let mut memory = Memory::new(&config, remembered.clone());
            do_job(run, Job::On);
            look(run, &mut memory);
            memory.finish(&mut run.operator);
            assert_eq!(memory.now().joints, remembered.joints);
            let home = run.operator.homing_order(0b001);
            do_job(run, Job::Home(home));
            look(run, &mut memory);
            let places = &memory.now().joints;
            assert!(places[0].homed && places[0].motor_mm.abs() < 1.0, "{places:?}");
            assert_eq!(places[1..], remembered.joints[1..]);
        });
    }

    /// Whoever has written `state.json` may have written anything into it.
    #[test]
    fn no_number_and_no_list_is_too_large() {
        let config = machine(usual);
        let mut remembered = Remembered {
            programs: u64::MAX,
            mdi: vec!["G0".into(); 5 * MDI_MAX],
            ..at_home()
        };
        remembered.parts.count = u64::MAX;
        let mut memory = Memory::new(&config, remembered);
        assert_eq!(memory.now().mdi.len(), MDI_MAX);
        memory.end_program(Outcome::Completed, true, 1);
        assert_eq!(memory.now().parts.count, u64::MAX);
        assert_eq!(memory.reports().next_number(u64::MAX), u64::MAX);
    }

    #[test]
    fn without_an_absolute_encoder_a_joint_is_homed_again() {
        assert_eq!(restarted(usual, at_home()), (Vec::new(), 0));
        let mut none = at_home();
        none.joints.iter_mut().for_each(|place| place.homed = false);
        assert_eq!(restarted(absolute, none), (Vec::new(), 0));
        // Nor does a file of more or fewer joints mean anything else.
        let mut fewer = at_home();
        fewer.joints.truncate(1);
        assert_eq!(restarted(absolute, fewer).1, 0b001);
        let mut more = at_home();
        more.joints.extend(at_home().joints);
        assert_eq!(restarted(absolute, more).1, 0b111);
    }

    #[test]
    fn switching_off_unhomes_volatile_joints_only() {
        fn volatile(homing: &mut Homing) {
            homing.volatile = true;
        }
        let homings: [fn(&mut Homing); 3] = [usual, volatile, absolute];
        for (homing, left) in homings.into_iter().zip([0b111, 0, 0b111]) {
            let config = machine(homing);
            stand_by(&config, |run| {
                let mut memory = Memory::new(&config, Remembered::default());
                let home = run.operator.homing_order(u64::MAX);
                do_job(run, Job::Home(home));
                look(run, &mut memory);
                assert_eq!(run.operator.live().homed, 0b111);
                switch_off(run);
                look(run, &mut memory);
                assert_eq!(run.operator.live().homed, left);
                let is_absolute = config.joints[0].homing.absolute_encoder;
                assert!(memory.now().joints.iter().all(|place| place.homed == is_absolute));
            });
        }
    }

    #[test]
    fn lines_of_mdi_and_the_last_program_are_kept() {
        let config = machine(usual);
        let mut memory = Memory::new(&config, Remembered::default());
        for line in 0..150 {
            memory.add_mdi(&format!("G0 X{line}"));
            memory.add_mdi(&format!("G0 X{line}"));
        }
        let lines = &memory.now().mdi;
        assert_eq!(
            (lines.len(), lines[0].as_str(), lines[99].as_str()),
            (100, "G0 X50", "G0 X149")
        );
        memory.begin_program("part.ngc");
        memory.end_program(Outcome::Stopped, false, 3);
        memory.end_program(Outcome::Completed, true, 4);
        assert_eq!(memory.now().parts.count, 1);
        memory.begin_program("next.ngc");
        let again = Memory::new(&config, memory.now().clone());
        let last = again.now().program.clone().expect("a program");
        assert_eq!(
            (last.name.as_str(), last.result),
            ("next.ngc", Some(LastResult::Interrupted))
        );
    }
}
