//! Set-points: where each joint is to be next, along the path of a program, by hand, homing, or at rest.
//!
//! In:  the program in the ring, the hand, homing; shares of the speed.
//! Out: one position per joint, looked at once more before it leaves.

use super::*;

impl MotionController<dyn CyclicBus + '_> {
    /// Next set-points of all joints.
    pub(super) fn interpolate(&mut self) {
        self.parts.probe.look();
        let overrides = &self.outlets.live.overrides;
        let mut wanted = Shares::all(0.0);
        if let Some(run) = &mut self.program {
            if self.state == State::Running && !run.hold {
                wanted = Shares {
                    all: run.reverse.map_or(1.0, |share| -share),
                    ..self.parts.feed.shares(overrides)
                };
            }
            run.is_fed_nothing = wanted.hold(self.sample.enables)
                || [Overridden::Feed, Overridden::Rapid]
                    .map(|what| overrides.percent(what))
                    .contains(&0.0);
        }
        match &self.program {
            Some(run) if run.away_from.is_none() => self.follow_path(&wanted),
            Some(_) => self.move_by_hand(),
            None => {
                self.sample = Sample::resting(self.sample.position);
                self.move_by_hand();
            }
        }
        self.see_action();
        let overrides = &self.outlets.live.overrides;
        self.parts.feed.follow(overrides);
        let share = match self.sample.enables.spindle_override {
            true => overrides.share(Overridden::Spindle),
            false => 1.0,
        };
        self.parts.spindles.first.set_override(share);
    }

    /// Joints follow the path of the program.
    fn follow_path(&mut self, wanted: &Shares) {
        let (parts, Some(run)) = (&mut self.parts, &mut self.program) else {
            return;
        };
        see_probe(parts, &mut run.program, &self.sample);
        let spindle = &mut parts.spindles.first;
        let shares = Shares {
            turning: spindle.feed_share(),
            ..*wanted
        };
        self.sample = run.program.step_shares(&shares, &spindle.place());
        run.cycles += 1;
        // Whoever runs block by block, or back, says when it goes on.
        run.hold |= run.program.is_block_over() || run.program.is_way_back_over();
        run.has_moved |= self.sample.state == SampleState::Moving;
        spindle.steer(&self.sample);
        let in_step = run.program.take_sync_report();
        let held = spindle.take_held();
        // A ramp to rest may just reach the end of a move: what stands behind it, a spindle say, must not begin then.
        let may_begin = !wanted.hold(self.sample.enables) && run.waiting.is_none();
        if let Some(outputs) = &self.sample.outputs {
            parts.program_outputs.set(outputs);
        }
        if let Some(action) = self.sample.on_the_way {
            self.notice(Notice::Action(action));
            self.begin_action(action);
        }
        if let Some(action) = self.sample.action.filter(|_| may_begin) {
            self.reach_action(action);
        }
        self.laps.end(Part::Interpolation);
        let (frame, position) = (&self.sample.frame, &self.sample.position.0);
        let inverse = (self.parts.kinematics).inverse(frame, position, &mut self.command_mm[..self.joints]);
        self.laps.end(Part::Kinematics);
        if let Err(unreachable) = inverse {
            // The joints stay where they are; the planner should have refused the move.
            self.fault(Fault::IllegalCommand {
                joint: unreachable.joint,
                line: self.sample.line,
            });
        }
        if let Some(share) = held {
            let line = self.sample.line;
            self.notice(Notice::SpindleHeld { line, share });
        }
        if let Some((line, report)) = in_step {
            self.notice(Notice::InStep { line, report });
        }
        // A move that was ended by a stop has no fault of its own.
        if let Some(fault) = self.sample.fault.filter(|&fault| fault != SyncFault::Aborted) {
            self.fault(Fault::OutOfStep { fault });
        }
    }

    /// Joints follow the hand, or home, or stay.
    fn move_by_hand(&mut self) {
        let by_hand = self.parts.hand.is_active();
        if by_hand {
            let is_jog = matches!(self.state, State::Jogging | State::Away);
            if is_jog && self.parts.jog.stops_at_once() {
                self.parts.hand.stop();
            } else if self.parts.feed.is_held() && self.state != State::Stopping || is_jog && self.parts.jog.stops() {
                self.parts.hand.release_all();
            }
            if self.parts.probe.stops_jog() {
                self.parts.hand.stop();
                // A way back is given up there.
                self.come_back(false);
                self.notice(Notice::Touched);
            }
            self.parts.hand.step(&mut self.command_mm[..self.joints]);
            if let Some(obstruction) = self.parts.hand.take_obstruction() {
                self.come_back(false);
                self.notice(Notice::Obstructed(obstruction));
            }
        } else {
            self.stay_or_home();
        }
        let joints = &self.command_mm[..self.joints];
        if let Some(position) = self.parts.kinematics.forward(&self.sample.frame, joints) {
            self.sample.position = position;
        }
        self.sample.velocity_mm_s = match () {
            () if by_hand => self.parts.hand.speed_mm_s(),
            () if self.parts.homer.is_active() => self.parts.homer.speed_mm_s(),
            () => 0.0,
        };
    }

    /// Whether a machine that is away from the path is to return there.
    pub(super) fn come_back(&mut self, comes_back: bool) {
        if let Some(run) = &mut self.program {
            run.goes_back = comes_back;
        }
    }

    /// The next leg of the way back, or its end.
    pub(super) fn go_back(&mut self) {
        let Some(run) = &mut self.program else { return };
        let Some(place) = &run.away_from else { return };
        if !run.goes_back {
            if self.parts.hand.is_at_rest() {
                self.parts.hand.end();
                self.enter(State::Away);
            }
            return;
        }
        if self.parts.feed.is_held() {
            self.parts.way_back.interrupt();
            return;
        }
        let overrides = &self.outlets.live.overrides;
        let shares = [Overridden::Rapid, Overridden::Feed].map(|what| overrides.share(what).min(1.0));
        match self.parts.way_back.step(place, &mut self.parts.hand, shares) {
            Progress::Moving => {}
            Progress::There => {
                self.parts.hand.end();
                run.away_from = None;
                self.enter(State::Held);
            }
            Progress::Elsewhere => {
                run.goes_back = false;
                self.parts.hand.end();
                self.notice(Notice::NoWayBack);
                self.enter(State::Away);
            }
        }
    }

    /// Each joint stays where it was told to be, but for those that home by the control.
    fn stay_or_home(&mut self) {
        let parts = &mut self.parts;
        let homing = parts.homer.under_way();
        for (joint, (command_mm, drive)) in self.command_mm.iter_mut().zip(parts.drives.iter()).enumerate() {
            if homing >> joint & 1 == 0 {
                *command_mm = drive.command_mm();
            }
        }
        if homing != 0 {
            let command_mm = &mut self.command_mm[..self.joints];
            parts.homer.step(&parts.drives, &parts.pins, command_mm);
        }
    }

    /// The last look at what leaves for the drives: numbers, inside the travel, within the limits. What is not does not leave.
    pub(super) fn check_commands(&mut self) {
        #[cfg(any(test, feature = "testing"))]
        self.tampering.tamper(&mut self.command_mm[..self.joints]);
        let command_mm = &mut self.command_mm[..self.joints];
        let scaling = match &self.program {
            Some(run) if run.away_from.is_none() => run.program.is_scaling(),
            _ if self.parts.hand.is_active() => self.parts.hand.is_stopping(),
            _ if self.parts.homer.is_active() => self.parts.homer.is_stopping(),
            _ => {
                self.stay();
                return;
            }
        };
        let homing = self.parts.homer.under_way();
        // Joints that home by their drives are led by these, and count again at the end. Travel has no meaning before a joint is homed: its
        // search is bounded by distances, and the hand goes as far as the travel is long.
        let drives = self.parts.drives.iter().enumerate();
        let homed = drives.fold(0, |mask, (joint, drive)| mask | u64::from(drive.is_homed()) << joint);
        let watched = Watched {
            moving: if homing != 0 { homing } else { u64::MAX },
            within_travel: if homing != 0 { 0 } else { homed },
        };
        let trip = self.parts.monitor.watch(command_mm, watched, scaling);
        if self.parts.monitor.holds_back()
            && let Some(position) = self.parts.kinematics.forward(&self.sample.frame, command_mm)
        {
            self.sample.position = position;
        }
        if let Some(trip) = trip {
            let line = self.program.as_ref().map_or(0, |_| self.sample.line);
            self.fault(match trip {
                Trip::NotFinite { joint } => Fault::IllegalCommand { joint, line },
                Trip::Beyond { joint, position } => Fault::SoftLimit {
                    joint,
                    position_mm: position,
                    line,
                },
                Trip::Over {
                    joint,
                    order,
                    value,
                    limit,
                } => Fault::LimitExceeded {
                    joint,
                    line,
                    order,
                    value,
                    limit,
                },
            });
        }
    }

    /// Nothing moves: each joint is told what it was told before, whatever the commands say.
    fn stay(&mut self) {
        let mut elsewhere = None;
        for (joint, (command_mm, drive)) in self.command_mm.iter_mut().zip(self.parts.drives.iter()).enumerate() {
            if *command_mm != drive.command_mm() {
                elsewhere = elsewhere.or(Some(joint));
                *command_mm = drive.command_mm();
            }
        }
        self.parts.monitor.rest_at(&self.command_mm[..self.joints]);
        if let Some(joint) = elsewhere {
            self.fault(Fault::IllegalCommand { joint, line: 0 });
        }
    }
}

/// Tells a program that probes what the probe and the drives have found; else what drives latch counts no more.
fn see_probe(parts: &mut CycleParts, program: &mut Interpolator, sample: &Sample) {
    if !program.is_probing() {
        parts.drives.arm_touch_probes();
        return;
    }
    let measured = parts.drives.measured(&parts.kinematics, sample);
    let latched = parts.drives.touched(&parts.kinematics, sample);
    // The probe may be wired to the drives alone: what all of them have latched is a contact, whatever the pin shows. For a
    // move towards the work it stays one, as a contact may bounce within a cycle.
    let [touched, released] = latched;
    let by_drives = touched.is_some() && (released.is_none() || program.is_probing_towards());
    program.see_probe(parts.probe.is_in_contact() || by_drives, &measured);
    program.see_latches(latched);
}
