#!/usr/bin/env python3
"""SOEM as the main device of our simulated devices: scan, objects, clocks, OP, motion; by pysoem.

In:  the interface at whose other end `cargo run --example simulate -p isocnc-ethercat` answers with two drives.
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


def main():
    master = pysoem.Master()
    master.open(sys.argv[1])
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
    master.config_map()
    expect(master.config_dc(), "there are clocks")
    for drive in drives:
        drive.dc_sync(True, int(CYCLE_S * 1e9))
    state = master.state_check(pysoem.SAFEOP_STATE, 5_000_000)
    expect(state == pysoem.SAFEOP_STATE, "all are in SAFE-OP")
    master.state = pysoem.OP_STATE
    master.write_state()
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
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


main()
