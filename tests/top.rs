//! `isocnc top` in a terminal: a pseudo terminal of 24 rows of 80 columns, keys as a person types them, a machine in memory.

use crate::common;

use common::{Control, PATIENCE};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use serde_json::json;
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

struct Screen {
    process: Child,
    terminal: File,
    shown: vt100::Parser,
}

impl Screen {
    fn open(machine: &str) -> Screen {
        let (mut near, mut far) = (-1, -1);
        let size = libc::winsize {
            ws_row: 24,
            ws_col: 80,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        // SAFETY: both numbers may be written, the size is read; no name and no settings are given.
        let made = unsafe {
            libc::openpty(
                &raw mut near,
                &raw mut far,
                std::ptr::null_mut(),
                std::ptr::null(),
                &raw const size,
            )
        };
        assert_eq!(made, 0);
        // SAFETY: it has just been opened. Whoever is started would keep the terminal open by it.
        assert_eq!(unsafe { libc::fcntl(near, libc::F_SETFD, libc::FD_CLOEXEC) }, 0);
        // SAFETY: they have just been opened, and nobody else has them.
        let (near, far) = unsafe { (OwnedFd::from_raw_fd(near), OwnedFd::from_raw_fd(far)) };
        let end = || Stdio::from(far.try_clone().unwrap());
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        command.args(["top", "--machine", machine]).env("TERM", "xterm");
        command.stdin(end()).stdout(end()).stderr(end());
        // SAFETY: the closure makes system calls only.
        unsafe {
            command.pre_exec(|| {
                nix::unistd::setsid()?;
                match libc::ioctl(0, libc::TIOCSCTTY, 0) {
                    0 => Ok(()),
                    _ => Err(std::io::Error::last_os_error()),
                }
            })
        };
        Screen {
            process: command.spawn().unwrap(),
            terminal: File::from(near),
            shown: vt100::Parser::new(24, 80, 0),
        }
    }

    fn press(&mut self, keys: &str) {
        self.terminal.write_all(keys.as_bytes()).unwrap();
    }

    /// Reads what comes within a moment.
    fn read(&mut self) {
        let mut ready = [PollFd::new(self.terminal.as_fd(), PollFlags::POLLIN)];
        if poll(&mut ready, PollTimeout::from(50_u8)).unwrap_or(0) == 0 {
            return;
        }
        let mut part = [0; 4096];
        // Its other end may have been closed.
        let count = self.terminal.read(&mut part).unwrap_or(0);
        self.shown.process(&part[..count]);
    }

    fn wait_for(&mut self, text: &str) {
        let give_up = Instant::now() + PATIENCE;
        while !self.shown.screen().contents().contains(text) {
            let shown = self.shown.screen().contents();
            assert!(Instant::now() < give_up, "never {text:?}:\n{shown}");
            self.read();
        }
    }

    /// Its exit code; the terminal is as it was: not the other screen, and with a cursor.
    fn end(mut self) -> Option<i32> {
        assert!(self.shown.screen().alternate_screen() && self.shown.screen().hide_cursor());
        let give_up = Instant::now() + PATIENCE;
        let code = loop {
            self.read();
            if let Some(status) = self.process.try_wait().unwrap() {
                break status.code();
            }
            assert!(Instant::now() < give_up, "it does not end");
        };
        self.read();
        assert!(!self.shown.screen().alternate_screen() && !self.shown.screen().hide_cursor());
        code
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_machine_is_worked_with_by_keys_and_a_control_that_is_killed_is_told_of() {
    let mut control = Control::start("screen", Stdio::null());
    control.wait_for("the network", |status| status["step"] == "standing_by");
    let mut screen = Screen::open(&control.machine);
    screen.wait_for("Esc stop");
    screen.wait_for("OFF  MANUAL  idle");
    screen.press("m");
    screen.press("G0 X1\r");
    screen.wait_for("drives are off: isocnc on");
    screen.press("\ro");
    control.wait_for("on", |status| status["power"] == "on" && status["job"] == "completed");
    screen.press("H");
    control.wait_for("home", |status| {
        status["homed"] == json!([0, 1, 2]) && status["job"] == "completed"
    });
    screen.press("mG53 G0 X20\r");
    let near = |status: &serde_json::Value, x: f64| (status["position_mm"][0].as_f64().unwrap() - x).abs() < 1e-6;
    control.wait_for("X 20", |status| near(status, 20.0) && status["job"] == "completed");
    // Out of the line; then an arrow that is held as a terminal repeats it, and let go.
    screen.press("\r");
    for _ in 0..15 {
        screen.press("\u{1b}[C");
        std::thread::sleep(Duration::from_millis(30));
    }
    let rests = |status: &serde_json::Value| status["state"] == "ready" && status["velocity_mm_s"] == 0.0;
    let at = control.wait_for("rest", |status| rests(status) && !near(status, 20.0));
    assert!(at["position_mm"][0].as_f64().unwrap() > 20.0, "{at}");
    // A step, which is as long as it says.
    screen.press("xxx");
    let x_mm = at["position_mm"][0].as_f64().unwrap();
    screen.press("\u{1b}[D");
    control.wait_for("a step", |status| rests(status) && near(status, x_mm - 0.1));
    screen.press("c");
    control.wait_for("control", |status| status["control"]["name"] == "top");
    control.refused(&["off"], "top (process ");
    screen.press("e");
    control.wait_for("estop", |status| status["power"] == "estop");
    let _ = control.process.kill();
    screen.wait_for("NO CONTROL:");
    screen.press("q");
    assert_eq!(screen.end(), Some(0));
}

#[test]
fn a_window_may_be_small_and_a_signal_leaves_the_terminal_as_it_was() {
    let mut screen = Screen::open("nobody-of-this-name");
    screen.wait_for("NO CONTROL:");
    let size = libc::winsize {
        ws_row: 5,
        ws_col: 30,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    // SAFETY: the size is read.
    let set = unsafe { libc::ioctl(screen.terminal.as_raw_fd(), libc::TIOCSWINSZ, &raw const size) };
    screen.shown.screen_mut().set_size(5, 30);
    assert_eq!(set, 0);
    screen.wait_for("make the window");
    let process = nix::unistd::Pid::from_raw(screen.process.id() as i32);
    nix::sys::signal::kill(process, nix::sys::signal::Signal::SIGTERM).unwrap();
    assert_eq!(screen.end(), Some(128 + 15));
}

#[test]
fn it_ends_with_its_terminal() {
    let mut screen = Screen::open("nobody-of-this-name");
    screen.wait_for("NO CONTROL:");
    // The window is closed: nobody has the near end of it any more.
    screen.terminal = File::open("/dev/null").unwrap();
    let give_up = Instant::now() + PATIENCE;
    while screen.process.try_wait().unwrap().is_none() {
        assert!(Instant::now() < give_up, "it does not end");
        std::thread::sleep(Duration::from_millis(20));
    }
}
