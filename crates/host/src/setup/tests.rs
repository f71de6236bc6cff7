//! The set-up on this PC, whatever it is, and its decisions on made-up ones.

use super::awake::{IdleThread, has_idle_states};
use super::priority::{CAP_IPC_LOCK, CAP_SYS_NICE, effective_capabilities, fifo_fix, is_initial_namespace};
use super::*;
use nix::sched::{CpuSet, sched_getaffinity};
use nix::unistd::Pid;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

fn rt(require: Require) -> Rt {
    Rt {
        cpu: Some(9_999),
        keep_awake: Some(KeepAwake::None),
        lock_memory: false,
        require,
        ..Rt::default()
    }
}

#[test]
fn lists_of_cores() {
    assert_eq!(cpu::list("0-1\n"), [0, 1]);
    assert_eq!(cpu::list("0,2-4,7"), [0, 2, 3, 4, 7]);
    assert_eq!(cpu::list("\n"), [0usize; 0]);
    assert!(!cpu::online().is_empty());
}

#[test]
fn the_core_is_the_wanted_or_the_last_isolated_or_the_last_one() {
    let mut findings = Vec::new();
    let mut choose =
        |wanted, online: &[usize], isolated: &[usize]| cpu::choose(wanted, online, isolated, &[], &mut findings);
    assert_eq!(choose(None, &[0, 1, 3], &[]), 3);
    assert_eq!(choose(None, &[0, 1, 2, 3], &[1, 2]), 2);
    assert_eq!(choose(None, &[0, 1], &[1, 7]), 1, "an isolated core may be off line");
    assert_eq!(choose(Some(0), &[0, 1, 3], &[1]), 0);
    assert_eq!(findings, []);
    let mut choose =
        |wanted, online: &[usize], isolated: &[usize]| cpu::choose(wanted, online, isolated, &[], &mut findings);
    assert_eq!(choose(Some(2), &[0, 1, 3], &[1]), 1);
    assert_eq!(choose(None, &[0], &[]), 0);
    let lines: Vec<String> = findings.iter().map(Finding::to_string).collect();
    assert_eq!(
        lines,
        [
            "real time, core: core 2 is not online, core 1 is taken; set rt.cpu to a core that is, or leave it out",
            "real time, core: there is only one core, shared with everything else; use a PC with two or more cores",
        ]
    );
}

#[test]
fn a_core_that_another_control_has_is_taken_only_where_there_is_no_other_and_told() {
    let on = |cpu| OtherControl { cpu, process: 77 };
    let choose = |wanted, isolated: &[usize], others: &[OtherControl]| {
        let mut findings = Vec::new();
        let cpu = cpu::choose(wanted, &[0, 1, 2, 3], isolated, others, &mut findings);
        (cpu, findings.iter().map(Finding::to_string).collect::<Vec<_>>())
    };
    assert_eq!(choose(None, &[], &[on(3)]), (2, vec![]));
    assert_eq!(choose(None, &[1, 2], &[on(2), on(3)]), (1, vec![]));
    assert_eq!(choose(None, &[3], &[on(3)]), (2, vec![]), "better alone than isolated");
    let shared = "real time, core: core 3 is also that of another control, process 77: each disturbs the other; ";
    assert_eq!(choose(None, &[], &[on(1), on(2), on(3)]), (0, vec![]));
    let (cpu, told) = choose(None, &[], &[on(0), on(1), on(2), on(3)]);
    assert_eq!(cpu, 3);
    assert_eq!(told, [format!("{shared}end one of them, or use a PC with more cores")]);
    let (cpu, told) = choose(Some(3), &[], &[on(3)]);
    assert_eq!(cpu, 3);
    assert_eq!(
        told,
        [format!("{shared}set rt.cpu of one of them to another core: 2 is free")]
    );
}

#[test]
fn findings_with_one_cure_are_one_line() {
    let findings = [
        Finding::new(Item::Priority, "SCHED_FIFO 80 is refused", "run as root"),
        Finding::new(Item::Core, "there is only one", "use another PC"),
        Finding::new(Item::Memory, "it cannot be locked", "run as root"),
    ];
    assert_eq!(
        by_cure(&findings),
        [
            "real time, priority: SCHED_FIFO 80 is refused; memory: it cannot be locked; run as root",
            "real time, core: there is only one; use another PC",
        ]
    );
}

#[test]
fn rights_inside_a_user_namespace_do_not_count() {
    assert!(is_initial_namespace("         0          0 4294967295\n"));
    assert!(!is_initial_namespace("         0       1000          1\n"));
    let status = "Name:\tx\nCapPrm:\t0000000000000000\nCapEff:\t0000000000804000\n";
    assert_eq!(effective_capabilities(status), 1 << CAP_SYS_NICE | 1 << CAP_IPC_LOCK);
    assert_eq!(effective_capabilities(""), 0);
}

#[test]
fn refused_priorities_are_explained() {
    assert_eq!(fifo_fix(false, "1:cpu:/x\n"), findings::RIGHTS);
    let v1 = fifo_fix(true, "2:memory:/\n1:cpu,cpuacct:/system.slice\n0::/\n");
    assert!(
        v1.contains("/sys/fs/cgroup/cpu,cpuacct/system.slice/cpu.rt_runtime_us"),
        "{v1}"
    );
    assert!(fifo_fix(true, "2:cpuset:/\n0::/user.slice\n").contains("root cgroup"));
}

#[test]
fn only_one_says_preempt_rt() {
    assert_eq!(findings::kernel(Some("1\n")), None);
    for other in [None, Some("0\n"), Some("")] {
        assert_eq!(findings::kernel(other).unwrap().item, Item::Kernel);
    }
}

#[test]
fn strict_refuses_with_all_findings_and_warn_runs_with_the_same() {
    let refusal = prepare_process(&rt(Require::Strict)).unwrap_err();
    let process = prepare_process(&rt(Require::Warn)).unwrap();
    assert_eq!(refusal.findings, process.findings);
    assert!(
        refusal
            .to_string()
            .contains("\n  real time, core: core 9999 is not online"),
        "{refusal}"
    );
    assert!(cpu::online().contains(&process.cpu));
}

#[test]
fn a_thread_enters_real_time_or_says_what_is_missing() {
    let process = prepare_process(&Rt {
        cpu: None,
        ..rt(Require::Warn)
    })
    .unwrap();
    let enter = || {
        let findings = enter_thread(Role::Cycle, &process);
        let blocked = SigSet::thread_get_mask()
            .unwrap()
            .contains(nix::sys::signal::Signal::SIGINT);
        let cores = sched_getaffinity(Pid::from_raw(0)).unwrap();
        let alone = (0..CpuSet::count())
            .filter(|cpu| cores.is_set(*cpu).unwrap())
            .eq([process.cpu]);
        // SAFETY: 0 is the calling thread; the call touches no memory.
        let fifo = unsafe { libc::sched_getscheduler(0) } == libc::SCHED_FIFO;
        (findings, blocked, alone, fifo)
    };
    let (findings, blocked, alone, fifo) = std::thread::scope(|scope| scope.spawn(enter).join().unwrap());
    let misses = |item| findings.iter().any(|finding| finding.item == item);
    assert!(blocked);
    assert_eq!(alone, !misses(Item::Core));
    assert_eq!(fifo, !misses(Item::Priority));
}

#[test]
fn the_spinning_thread_ends_when_it_is_dropped() {
    let awake = IdleThread::spawn(*cpu::online().last().unwrap()).unwrap();
    let stop = awake.stop_flag();
    drop(awake);
    assert!(stop.load(Ordering::Relaxed));
    // It runs behind all others, so not at once.
    while Arc::strong_count(&stop) > 1 {
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn nobody_waits_for_a_spinning_thread_whose_core_others_keep_busy() {
    let core = *cpu::online().last().unwrap();
    let over = AtomicBool::new(false);
    let (busy, is_busy) = std::sync::mpsc::sync_channel(1);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            // What has no right to SCHED_FIFO keeps the spinning thread from the core for most of the time only.
            drop(enter_core(core, 1));
            busy.send(()).unwrap();
            while !over.load(Ordering::Relaxed) {
                std::hint::spin_loop()
            }
        });
        is_busy.recv().unwrap();
        // The busy thread ends behind these only.
        for _ in 0..10 {
            drop(IdleThread::spawn(core).unwrap());
        }
        over.store(true, Ordering::Relaxed);
    });
}

#[test]
fn a_core_that_there_is_not_is_kept_awake_by_nobody() {
    let cause = IdleThread::spawn(9_999).unwrap_err();
    assert!(cause.contains("core 9999 cannot be taken"), "{cause}");
}

#[test]
fn each_way_to_keep_awake_is_had_or_named_and_replaced() {
    let mut process = prepare_process(&Rt {
        cpu: None,
        ..rt(Require::Warn)
    })
    .unwrap();
    assert_eq!(process.kept_awake(), KeepAwake::None);
    assert_eq!(process.keep_awake(KeepAwake::IdleThread), Ok(()));
    assert_eq!(process.kept_awake(), KeepAwake::IdleThread);
    match process.keep_awake(KeepAwake::DmaLatency) {
        Ok(()) => assert_eq!(process.kept_awake(), KeepAwake::DmaLatency),
        Err(finding) => assert_eq!(
            (finding.item, process.kept_awake()),
            (Item::IdleStates, KeepAwake::IdleThread)
        ),
    }
    assert_eq!(process.keep_awake(KeepAwake::None), Ok(()));
    assert_eq!(process.kept_awake(), KeepAwake::None);
}

#[test]
fn idle_states_are_those_of_a_driver() {
    assert!(has_idle_states("intel_idle\n") && has_idle_states("haltpoll\n"));
    assert!(!has_idle_states("none\n") && !has_idle_states(""));
}

#[test]
fn ordinary_threads_keep_off_the_core_and_stay_where_there_is_no_other() {
    let cores = || {
        let set = sched_getaffinity(Pid::from_raw(0)).unwrap();
        (0..CpuSet::count())
            .filter(|cpu| set.is_set(*cpu).unwrap())
            .collect::<Vec<_>>()
    };
    let check = || {
        let mut wanted = cores();
        // One core after the other, until the last one, which stays.
        while wanted.len() > 1 {
            let core = wanted.remove(0);
            assert_eq!(cpu::keep_off(&[core], &[]), None);
            assert_eq!(cores(), wanted);
        }
        assert_eq!(cpu::keep_off(&[wanted[0]], &[]), None);
        assert_eq!(cores(), wanted);
    };
    std::thread::scope(|scope| scope.spawn(check).join().unwrap());
}

#[test]
fn cores_for_housekeeping_are_those_that_are_named() {
    let cores = || {
        let set = sched_getaffinity(Pid::from_raw(0)).unwrap();
        (0..CpuSet::count())
            .filter(|cpu| set.is_set(*cpu).unwrap())
            .collect::<Vec<_>>()
    };
    let check = || {
        let all = cores();
        let last = *all.last().unwrap();
        // Also one that is a core of real time: that is how it was asked for.
        assert_eq!(cpu::keep_off(&[last], &[last, 9998]), None);
        assert_eq!(cores(), [last]);
        // One that is not there changes nothing, and is told.
        let finding = cpu::keep_off(&[last], &[CpuSet::count() - 1]).expect("a finding");
        assert!(finding.to_string().contains("housekeeping"), "{finding}");
        assert_eq!(cores(), [last]);
    };
    std::thread::scope(|scope| scope.spawn(check).join().unwrap());
}

#[test]
fn the_time_out_thread_has_a_core_of_its_own_where_that_is_there() {
    let choose = |wanted| {
        let mut findings = Vec::new();
        let cpu = cpu::choose_second(wanted, 1, &[0, 1, 2], &mut findings);
        (cpu, findings.len())
    };
    assert_eq!(
        [None, Some(2), Some(1), Some(3)].map(choose),
        [(1, 0), (2, 0), (1, 0), (1, 1)]
    );
}
