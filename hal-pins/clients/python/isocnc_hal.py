"""External components of isocnc in Python: the standard library only.

A component whose pins the machine file declares ([[hal.external]]) belongs to the control; one process at a time writes its
outputs and reads its inputs:

    with isocnc_hal.claim("lamp") as lamp:
        while True:
            lamp.update()
            lamp["green"] = lamp["running"]
            time.sleep(lamp.heartbeat_s / 3)

`update` takes the inputs, writes all outputs together and renews the heartbeat. A process that does not call it within
`heartbeat_s` has lost the component: its outputs fall to the safe values of the machine file, and `update` raises `Ended`;
`begin` begins anew.

What is atomic: Python has no atomic memory access, and promises no order of what it writes to a mapping. Nothing here needs
either: a record has a check over all its words, and whoever reads takes it only if that fits, so values that belong together are
seen together or not at all, on any processor. Words are copied eight octets at a time, which is one access on the processors that
isocnc runs on; the lock that makes a process the one writer is the kernel's.

The protocol is in docs/external-components.md. Licence: MIT or Apache 2.0, as isocnc.
"""

import fcntl
import mmap
import os
import stat
import struct
import time

__all__ = ["claim", "Component", "HalError", "Claimed", "Ended", "Gone"]

_MAGIC = int.from_bytes(b"isocEXT\n", "little")
_VERSION = 1
_PINS, _INPUTS, _HEARTBEAT_MS = 3, 4, 5
_SESSION, _HOLDER, _LATEST_OUTPUTS, _CLAIMS = 8, 9, 10, 11
_ENDED, _LATEST_INPUTS = 12, 13
_HEADER, _PIN, _FRAME = 16, 10, 3
_PINS_MAX = 256
_WORD = (1 << 64) - 1
_TYPES = {1: "bit", 2: "s32", 3: "u32", 4: "s64", 5: "u64", 6: "float"}
_RANGES = {
    "s32": (-(1 << 31), (1 << 31) - 1),
    "u32": (0, (1 << 32) - 1),
    "s64": (-(1 << 63), (1 << 63) - 1),
    "u64": (0, _WORD),
}
_FIRST_LOOK_S = 2.0


class HalError(Exception):
    """There is no such component, or its file is damaged."""


class Claimed(HalError):
    """Another process has claimed the component."""


class Ended(HalError):
    """The session is over: outputs have their safe values. `begin` begins anew."""


class Gone(HalError):
    """The control has ended."""


def _mix(check, word):
    mixed = ((check ^ word) * 0x9E3779B97F4A7C15) & _WORD
    return mixed ^ (mixed >> 32)


def _to_cell(kind, value):
    if kind == "bit":
        return 1 if value else 0
    if kind == "float":
        return struct.unpack("<Q", struct.pack("<d", value))[0]
    low, high = _RANGES[kind]
    if not low <= value <= high:
        raise ValueError(f"{value} is no {kind}: expected {low} to {high}")
    return int(value) & (0xFFFFFFFF if kind in ("s32", "u32") else _WORD)


def _from_cell(kind, cell):
    if kind == "bit":
        return cell != 0
    if kind == "float":
        return struct.unpack("<d", struct.pack("<Q", cell))[0]
    width = 32 if kind in ("s32", "u32") else 64
    value = cell & ((1 << width) - 1)
    return value - (1 << width) if kind[0] == "s" and value >> (width - 1) else value


def _runs(file):
    """Whether the control holds its lock on a file."""
    whole = struct.pack("@hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
    answer = fcntl.fcntl(file, getattr(fcntl, "F_OFD_GETLK", 36), whole)
    return struct.unpack("@hhqqi4x", answer)[0] != fcntl.F_UNLCK


def _folders():
    """Folders of this user's controls, best first: each his alone."""
    user = os.geteuid()
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    places = ["/run/isocnc", f"/run/user/{user}/isocnc", f"/dev/shm/isocnc-{user}"]
    if runtime:
        places.insert(1, os.path.join(runtime, "isocnc"))
    for place in dict.fromkeys(places):
        try:
            found = os.lstat(place)
        except OSError:
            continue
        if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o077:
            yield place


def _find(machine, component):
    """Files of controls that run and have the component."""
    prefix = f"isocnc-external-{component.replace('.', '_')}."
    for folder in _folders():
        for name in sorted(os.listdir(folder)):
            if not name.startswith(prefix) or machine not in (None, name[len(prefix):]):
                continue
            try:
                file = os.open(os.path.join(folder, name), os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
            except OSError:
                continue
            found = os.fstat(file)
            if stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and _runs(file):
                yield file
            else:
                os.close(file)


def claim(component, machine=None):
    """Claims a component of a running control; the machine may be left out where one control alone has it.

    Raises `Claimed` while another process has it, `HalError` where there is none.
    """
    files = list(_find(machine, component))
    if len(files) == 1:
        return Component(files[0], component)
    for file in files:
        os.close(file)
    if files:
        raise HalError(f"several controls have the external component '{component}': name the machine")
    raise HalError(f"no control of this user that runs has an external component '{component}'")


class Component:
    """The one writer of an external component; `component[name]` is the value of a pin."""

    def __init__(self, file, name):
        self._file, self._words, self._session = file, None, 0
        try:
            length = os.fstat(file).st_size
            if length % 8 or not 8 * _HEADER <= length < 1 << 20:
                raise HalError(f"external component '{name}': its file is damaged: {length} octets")
            self._map = mmap.mmap(file, length)
            self._words = memoryview(self._map).cast("Q")
            self._read(name)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Claimed(
                    f"external component '{name}' is claimed by process {self._words[_HOLDER]}: "
                    "it has one writer at a time; end that process first"
                ) from None
            self._written = self._words[_LATEST_OUTPUTS]
            self._seen = 0
            self.begin()
        except BaseException:
            self.release()
            raise

    def _read(self, name):
        words = self._words
        pins, inputs = words[_PINS], words[_INPUTS]
        if words[0] != _MAGIC or words[1] != _VERSION or pins > _PINS_MAX or inputs > pins:
            raise HalError(f"external component '{name}': its file is damaged, or of another version of isocnc")
        self._inputs = inputs
        self._of_outputs = _HEADER + pins * _PIN
        self._of_inputs = self._of_outputs + 2 * (pins - inputs + _FRAME)
        if len(words) != self._of_inputs + 2 * (pins + _FRAME):
            raise HalError(f"external component '{name}': its file is damaged: {len(words)} words for {pins} pins")
        self.heartbeat_s = words[_HEARTBEAT_MS] / 1000
        self._pins, self._types = {}, []
        for pin in range(pins):
            described = words[_HEADER + pin * _PIN : _HEADER + (pin + 1) * _PIN].tolist()
            kind, direction, length = described[0] & 0xFF, described[0] >> 8 & 0xFF, described[0] >> 16
            if kind not in _TYPES or direction != (2 if pin < inputs else 1) or length > 64:
                raise HalError(f"external component '{name}': its file is damaged: pin {pin}")
            text = struct.pack("<8Q", *described[2:])[:length].decode("ascii", "replace")
            self._pins[text] = pin
            self._types.append(_TYPES[kind])
        self._cells = [0] * pins

    def begin(self):
        """Begins a session, with outputs as they are in the control now; after `Ended`."""
        until = time.monotonic() + _FIRST_LOOK_S
        while (cells := self._look()) is None:
            if time.monotonic() > until or not _runs(self._file):
                raise Gone("the control shows no values: it has ended, or hangs")
            time.sleep(0.001)
        self._cells = cells
        words = self._words
        session = (words[_CLAIMS] + 1) & _WORD
        while session in (0, words[_ENDED]):
            session = (session + 1) & _WORD
        words[_CLAIMS] = session
        words[_HOLDER] = os.getpid()
        words[_SESSION] = session
        self._session = session

    def _look(self):
        """Values of a fresh record of what the control shows."""
        words, pins = self._words, len(self._types)
        for _ in range(3):
            latest = words[_LATEST_INPUTS]
            if latest in (0, self._seen):
                return None
            first = self._of_inputs + (latest & 1) * (pins + _FRAME)
            number, tag, *cells, check = words[first : first + pins + _FRAME].tolist()
            mixed = _mix(_mix(1, number), tag)
            for cell in cells:
                mixed = _mix(mixed, cell)
            if number == latest and mixed == check:
                self._seen = latest
                return cells
        return None

    def update(self):
        """Takes inputs, writes all outputs together, renews the heartbeat. Where it raises nothing was written."""
        if self._words is None:
            raise Gone("the component is released")
        words, cells = self._words, self._look()
        if cells is None and not _runs(self._file):
            raise Gone("the control has ended")
        if words[_ENDED] == self._session:
            raise Ended("the heartbeat was late: the control has ended the session")
        if words[_SESSION] != self._session:
            raise Ended("another process has written over the session")
        if cells is not None:
            self._cells[: self._inputs] = cells[: self._inputs]
        self._written = (self._written + 1) & _WORD or 1
        outputs = self._cells[self._inputs :]
        first = self._of_outputs + (self._written & 1) * (len(outputs) + _FRAME)
        check = 1
        for at, word in enumerate((self._written, self._session, *outputs)):
            words[first + at] = word
            check = _mix(check, word)
        words[first + len(outputs) + 2] = check
        words[_LATEST_OUTPUTS] = self._written

    def pins(self):
        """Names of its pins: inputs, then outputs."""
        return list(self._pins)

    def __getitem__(self, name):
        pin = self._pins[name]
        return _from_cell(self._types[pin], self._cells[pin])

    def __setitem__(self, name, value):
        pin = self._pins[name]
        if pin < self._inputs:
            raise HalError(f"'{name}' is an input of this component")
        self._cells[pin] = _to_cell(self._types[pin], value)

    def release(self):
        """Gives the component up: its outputs fall to their safe values at once."""
        if self._words is not None:
            if self._session and self._words[_SESSION] == self._session:
                self._words[_SESSION] = 0
            self._words.release()
            self._map.close()
            self._words = None
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.release()
