#!/usr/bin/env python3
"""SOEM as the main device of our simulated devices: scan, objects, clocks, OP, motion; by pysoem.

In:  the interface at whose other end `cargo run --example simulate -p isocnc-ethercat` answers with two drives; with `machine` behind
     it, `isocnc simulate configs/mill3-ethercat.toml`.
Out: a line for each thing seen; exit code 0, or 1 and what was otherwise.
"""

import struct
import sys
import time

import pysoem

DRIVE = 0x04020001
CYCLES = 1500
CYCLE_S = 0.002
# A busy PC may be late at times; what is lost in between shows here.
GOOD_SHARE = 0.5


def expect(holds, words):
    print(("ok     " if holds else "FAILED ") + words)
    if not holds:
        sys.exit(1)


def control_word(status):
    state = status & 0x6F
    if state in (0x40, 0x60):
        return 0x06
    return 0x07 if state == 0x21 else 0x0F


def come_to_op(master, drives):
    master.config_map()
    expect(master.config_dc(), "there are clocks")
    for drive in drives:
        drive.dc_sync(True, int(CYCLE_S * 1e9))
    state = master.state_check(pysoem.SAFEOP_STATE, 5_000_000)
    expect(state == pysoem.SAFEOP_STATE, "all are in SAFE-OP")
    master.state = pysoem.OP_STATE
    master.write_state()


def machine(master):
    """Three drives and an I/O node, with the process data of the machine file."""
    expect(master.config_init() == 4, "three drives and an I/O node are found")
    *drives, io = master.slaves
    products = [slave.id for slave in master.slaves]
    expect(products == [0x04020002] * 3 + [0x04010002], f"products {products}")
    name = drives[2].sdo_read(0x1008, 0)
    expect(name == b"z-drive", f"object 1008h of the third is {name!r}")
    come_to_op(master, drives)
    targets, began, moved = [0] * 3, [0] * 3, [0] * 3
    good = 0
    for _ in range(CYCLES):
        for number, drive in enumerate(drives):
            status, _mode, _inputs, _code, position, _error = struct.unpack_from("<HbIHii", drive.input)
            if status & 0x6F == 0x27:
                targets[number] += 10
                moved[number] = position - began[number]
            else:
                targets[number] = began[number] = position
            drive.output = struct.pack("<HbIi", control_word(status), 8, 0, targets[number])
        io.output = bytes([0b101, 0])
        master.send_processdata()
        good += master.receive_processdata(int(CYCLE_S * 1e6)) == master.expected_wkc
        time.sleep(CYCLE_S)
    master.read_state()
    states = [slave.state for slave in master.slaves]
    expect(states == [pysoem.OP_STATE] * 4, f"all are in OP: {states}")
    expect(good >= GOOD_SHARE * CYCLES, f"{good} of {CYCLES} cycles have the working counter {master.expected_wkc}")
    expect(min(moved) > 1000, f"the drives have moved by {moved}")
    expect(io.input[0] == 0b101, f"the contacts of the I/O node come back: {io.input[0]:#b}")


def main():
    master = pysoem.Master()
    master.open(sys.argv[1])
    if sys.argv[2:] == ["machine"]:
        machine(master)
    else:
        example(master)
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


def example(master):
    """Two drives, a digital and an analog terminal."""
    expect(master.config_init() == 4, "two drives and two terminals are found")
    names = [slave.name for slave in master.slaves]
    expect(names == ["ISOCNC-SIM", "ISOCNC-SIM", "DIO-8-8", "AIO-4-4"], f"their names: {names}")
    drives = [slave for slave in master.slaves if slave.id == DRIVE]
    name = drives[0].sdo_read(0x1008, 0)
    expect(name == b"Simulated servo drive", f"object 1008h is {name!r}")
    drives[1].sdo_write(0x6060, 0, struct.pack("b", 8))
    expect(drives[1].sdo_read(0x6060, 0) == b"\x08", "object 6060h is written")
    try:
        drives[0].sdo_read(0x2345, 0)
        expect(False, "an object that there is not is refused")
    except pysoem.SdoError as error:
        expect(error.abort_code == 0x06020000, f"an object that there is not is refused: {error}")
    come_to_op(master, drives)
    targets = [0] * len(drives)
    good = 0
    for _ in range(CYCLES):
        for number, drive in enumerate(drives):
            status, _mode, _gap, position = struct.unpack_from("<HbBi", drive.input)
            targets[number] = targets[number] + 10 if status & 0x6F == 0x27 else position
            drive.output = struct.pack("<HbBi", control_word(status), 8, 0, targets[number])
        master.send_processdata()
        good += master.receive_processdata(int(CYCLE_S * 1e6)) == master.expected_wkc
        time.sleep(CYCLE_S)
    master.read_state()
    states = [slave.state for slave in master.slaves]
    expect(states == [pysoem.OP_STATE] * 4, f"all are in OP: {states}")
    expect(good >= GOOD_SHARE * CYCLES, f"{good} of {CYCLES} cycles have the working counter {master.expected_wkc}")
    positions = [struct.unpack_from("<i", drive.input, 4)[0] for drive in drives]
    expect(min(positions) > 1000, f"the drives have moved to {positions}")


main()
