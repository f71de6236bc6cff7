//! Orders of parts: which machine makes which one, and what became of each attempt.
//!
//! In:  machines that are free, what controls say of attempts. Out: programs and runs for controls.

use super::{ASK_AGAIN_S, Asked, Core, FAILURES_MAX, Machine, Outcome, REST_S, Reply, SLOW, UPLOADS_MAX};
use crate::store::{Attempt, OrderIs, PartsOrder};
use cell_link::message::{Order, OrderState, Phase, Remote, Topic, Upload, What};
use serde_json::Value;
use std::collections::HashSet;

impl Core {
    pub(super) fn upload(
        &mut self,
        machine: &str,
        upload: &Upload,
        content: Vec<u8>,
        order: Option<i64>,
        reply: Option<Reply>,
    ) {
        if let Some(known) = self.machines.get_mut(machine) {
            known.uploads += 1;
        }
        let attachment = self.say(upload);
        let asked = Asked::Upload {
            machine: machine.to_owned(),
            name: upload.name.clone(),
            sha256: upload.sha256.clone(),
            order,
            reply,
        };
        self.question(machine, Topic::Program, content, Some(attachment), SLOW, asked);
    }

    pub(super) fn run(
        &mut self,
        machine: &str,
        program: &str,
        sha256: &str,
        order: Option<i64>,
        reply: &mut Option<Reply>,
        now: f64,
    ) -> Outcome<()> {
        let attempt = Attempt {
            id: (self.ids)(),
            order,
            machine: machine.to_owned(),
            program: program.to_owned(),
            sha256: sha256.to_owned(),
            phase: Phase::Unknown,
            note: String::new(),
            sent_unix_s: now,
            took_s: None,
        };
        self.store.add_attempt(&attempt)?;
        self.send_run(&attempt, reply.take());
        if let Some(known) = self.machines.get_mut(machine) {
            known.attempt = Some((attempt, now));
        }
        Ok(())
    }

    pub(super) fn send_run(&mut self, attempt: &Attempt, reply: Option<Reply>) {
        let order = Order {
            id: attempt.id.clone(),
            what: What::Run {
                program: attempt.program.clone(),
                sha256: attempt.sha256.clone(),
            },
            boot: self.machines.get(&attempt.machine).and_then(Machine::boot),
        };
        let payload = self.say(order);
        let asked = Asked::Attempt(attempt.machine.clone(), attempt.id.clone(), reply);
        self.question(&attempt.machine, Topic::Run, payload, None, SLOW, asked);
    }

    /// What a control says of an order.
    pub(super) fn attempt_is(&mut self, name: &str, state: &OrderState, now: f64) -> Outcome<()> {
        let Some(machine) = self.machines.get_mut(name) else {
            return Ok(());
        };
        let Some((attempt, asked_s)) = &mut machine.attempt else {
            return Ok(());
        };
        if attempt.id != state.id {
            return Ok(());
        }
        *asked_s = now;
        if attempt.phase == state.phase {
            return Ok(());
        }
        attempt.phase = state.phase;
        self.store.set_attempt(state, now)?;
        if !state.phase.is_over() {
            return Ok(());
        }
        let Attempt { order, program, .. } = attempt.clone();
        machine.attempt = None;
        if state.phase == Phase::Refused {
            machine.rests_until_s = now + REST_S;
            // The machine may have lost it: the next try sends it again.
            if order.is_some() {
                self.store.set_stored(name, &program, None)?;
            }
        }
        self.is_queue_due = true;
        match order {
            Some(order) => self.settle(order),
            None => Ok(()),
        }
    }

    /// Ends an order that has all its parts, and holds one that fails again and again.
    pub(super) fn settle(&mut self, id: i64) -> Outcome<()> {
        let Some(order) = self.store.orders(true)?.into_iter().find(|order| order.id == id) else {
            return Ok(());
        };
        if order.completed >= order.wish.count {
            self.store.set_order(id, OrderIs::Done, "")?;
            return Ok(());
        }
        let last = self.store.attempts_of(id, FAILURES_MAX as u32)?;
        let has_failed = |attempt: &Attempt| matches!(attempt.phase, Phase::Failed | Phase::Interrupted);
        if last.len() == FAILURES_MAX && last.iter().all(has_failed) {
            let note = format!(
                "{FAILURES_MAX} attempts failed one after the other, the last one: {}",
                last[0].note
            );
            self.store.set_order(id, OrderIs::Held, &note)?;
        }
        Ok(())
    }

    /// Whether an attempt may still begin: its order is open, or it has none.
    pub(super) fn is_wanted(&self, id: &str) -> Outcome<bool> {
        let attempt = self.store.open_attempts()?.into_iter().find(|attempt| attempt.id == id);
        let Some(order) = attempt.and_then(|attempt| attempt.order) else {
            return Ok(true);
        };
        Ok(self.store.orders(true)?.iter().any(|open| open.id == order))
    }

    /// Asks about attempts of which nothing was heard for a while.
    pub(super) fn ask_again(&mut self, now: f64) -> Outcome<()> {
        let under_way: HashSet<&String> = (self.asked.values())
            .filter_map(|(asked, _)| match asked {
                Asked::Attempt(_, id, _) => Some(id),
                _ => None,
            })
            .collect();
        let mut silent = Vec::new();
        for machine in self.machines.values() {
            if let Some((attempt, asked_s)) = &machine.attempt
                && machine.is_there(now)
                && machine.gets_no_orders(now).is_none()
                && now - asked_s > ASK_AGAIN_S
                && !under_way.contains(&attempt.id)
            {
                silent.push(attempt.clone());
            }
        }
        for attempt in silent {
            if let Some((_, asked_s)) = self
                .machines
                .get_mut(&attempt.machine)
                .and_then(|machine| machine.attempt.as_mut())
            {
                *asked_s = now;
            }
            if attempt.phase == Phase::Unknown && self.is_wanted(&attempt.id)? {
                // The same id: a control that has carried it out says how it went.
                self.send_run(&attempt, None);
            } else {
                let asked = Asked::Attempt(attempt.machine.clone(), attempt.id.clone(), None);
                let order = Order {
                    id: attempt.id,
                    what: What::Status,
                    boot: self.machines.get(&attempt.machine).and_then(Machine::boot),
                };
                self.ask(&attempt.machine, Topic::Order, order, asked);
            }
        }
        Ok(())
    }

    /// Gives open orders to machines that are free and fit.
    pub(super) fn plan_queue(&mut self, now: f64) -> Outcome<()> {
        for order in self.store.orders(true)? {
            let mut missing = order.wish.count.saturating_sub(order.completed + order.under_way) as usize;
            missing = missing.saturating_sub(self.uploads_of(order.id));
            let mut names: Vec<&String> = self.machines.keys().collect();
            names.sort();
            let free: Vec<String> = (names.into_iter())
                .filter(|name| self.machines[*name].takes(&order, now))
                .cloned()
                .collect();
            for name in free {
                if missing == 0 {
                    break;
                }
                let has = self.store.stored(&name, &order.wish.program)?;
                if has.as_ref() == Some(&order.sha256) {
                    self.run(
                        &name,
                        &order.wish.program,
                        &order.sha256,
                        Some(order.id),
                        &mut None,
                        now,
                    )?;
                } else if self.machines.values().map(|machine| machine.uploads).sum::<usize>() < UPLOADS_MAX {
                    let Some(content) = self.store.program(&order.sha256)? else {
                        continue;
                    };
                    let upload = Upload::of(&order.wish.program, &content);
                    self.upload(&name, &upload, content, Some(order.id), None);
                }
                missing -= 1;
            }
        }
        Ok(())
    }

    pub(super) fn uploads_of(&self, id: i64) -> usize {
        let of = |(asked, _): &&(Asked, f64)| matches!(asked, Asked::Upload { order: Some(order), .. } if *order == id);
        self.asked.values().filter(of).count()
    }
}

impl Machine {
    /// Whether it is free for an order.
    pub(super) fn takes(&self, order: &PartsOrder, now: f64) -> bool {
        self.is_there(now)
            && self.state.is_ready
            && self.state.remote == Remote::Run
            && self.attempt.is_none()
            && self.uploads == 0
            && now >= self.rests_until_s
            && !self.unfit.contains_key(&order.id)
            && self.lacks(order).is_none()
    }

    /// What it lacks for an order, as far as its description tells.
    pub(super) fn lacks(&self, order: &PartsOrder) -> Option<String> {
        let wish = &order.wish;
        if !wish.class.is_empty() && wish.class != self.class {
            return Some(format!("is of class {:?}", self.class));
        }
        let axes = self.described["machine"]["axes"].as_array();
        let axis = |letter: char| {
            let is = |axis: &&Value| axis["axis"].as_str() == Some(letter.to_string().as_str());
            axes.into_iter().flatten().find(is)
        };
        if let Some(letter) = wish.axes.chars().find(|letter| axis(*letter).is_none()) {
            return Some(format!("has no axis {letter}"));
        }
        for (letter, wanted) in &wish.travel {
            let travel = axis(*letter).and_then(|axis| Some(axis["travel"][1].as_f64()? - axis["travel"][0].as_f64()?));
            match travel {
                Some(travel) if travel >= *wanted => {}
                Some(travel) => return Some(format!("travel of {letter} is {travel}, {wanted} is wanted")),
                None => return Some(format!("travel of {letter} is not known")),
            }
        }
        let tools = self.described["tools"]["tools"].as_array();
        let has = |number: &u32| tools.into_iter().flatten().any(|tool| tool["tool"] == *number);
        wish.tools
            .iter()
            .find(|number| !has(number))
            .map(|number| format!("has no tool {number}"))
    }
}
