"""A client of a running isocnc control: JSON-RPC 2.0 over its Unix socket, by the standard library alone.

    from isocnc import Control
    with Control("mill3") as control:
        control.call("on")
        control.wait()
        print(control.call("status")["power"])
"""

import base64
import hashlib
import json
import os
import socket
import struct
import time


# Changes that wait for whoever has subscribed and gives orders meanwhile.
TOLD_MAX = 1000


class Refused(Exception):
    """The control does not do it; the text says why, and what would help."""


class Failed(Exception):
    """It was begun and did not come to its end."""


def folders():
    """Where the socket may be, as docs/control-socket.md says."""
    yield "/run/isocnc"
    if "XDG_RUNTIME_DIR" in os.environ:
        yield os.path.join(os.environ["XDG_RUNTIME_DIR"], "isocnc")
    yield f"/dev/shm/isocnc-{os.getuid()}"


class Control:
    """A connection to the control of a machine."""

    def __init__(self, machine):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        for folder in folders():
            path = os.path.join(folder, f"isocnc-control.{machine}")
            try:
                self.socket.connect(path)
                break
            except OSError:
                continue
        else:
            raise Refused(f"no control of machine {machine} runs")
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")
        self.last = 0
        self.state = None
        self.told = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.lines.close()
        self.socket.close()

    def call(self, method, **params):
        """Asks for something and gives the answer; an order that takes time is answered when it begins."""
        self.last += 1
        request = {"jsonrpc": "2.0", "id": self.last, "method": method, "params": params}
        self.socket.sendall(json.dumps(request).encode() + b"\n")
        while True:
            answer = self._message()
            if "method" in answer:
                if len(self.told) < TOLD_MAX:
                    self.told.append(answer["params"])
                else:
                    # Nobody reads them: the last one has what the ones before it have changed.
                    self.told[-1]["changed"].update(answer["params"]["changed"])
                continue
            if answer.get("id") != self.last:
                continue
            if "error" in answer:
                raise Refused(answer["error"]["message"])
            return answer["result"]

    def _message(self):
        line = self.lines.readline()
        if not line:
            raise Refused("the control has ended")
        return json.loads(line)

    def subscribe(self, rate_hz=20):
        """Yields how everything is, and again whenever something has changed; orders may be given meanwhile."""
        self.state = self.call("subscribe", rate_hz=rate_hz)["state"]
        yield self.state
        while True:
            params = self.told.pop(0) if self.told else self._message().get("params")
            if params:
                self.state.update(params["changed"])
                yield self.state

    def take_control(self, name, force=False):
        """From now on others only watch, until the end of this connection or control.release."""
        return self.call("control.take", name=name, force=force)

    def upload(self, name, octets):
        """Sends a program; load or run it with upload=NUMBER."""
        begun = self.call("program.upload.begin", name=name, octets=len(octets))
        number, part = begun["upload"], begun["part_octets"]
        for at in range(0, len(octets), part):
            self.call("program.upload.append", upload=number, at=at, value=octets[at:at + part].hex())
        self.call("program.upload.commit", upload=number, sha256=hashlib.sha256(octets).hexdigest())
        return number

    def path(self, tolerance_mm=0.01):
        """Yields the way of the program that is loaded: line, kind (0 begin, 1 rapid, 2 feed, 3 curve, 4 probe), axes (machine)."""
        begun = self.call("program.path.begin", tolerance_mm=tolerance_mm)
        record = struct.Struct(f"<IB{len(begun['axes'])}f")
        part = {"end": False}
        while not part["end"]:
            part = self.call("program.path.next", path=begun["path"])
            for line, kind, *axes in record.iter_unpack(base64.b64decode(part["base64"])):
                yield line, kind, axes
        if part["error"]:
            raise Failed(part["error"])

    def wait(self, until=lambda status: status["job"] is not None, pause_s=0.02):
        """Looks again and again until a status is as wanted: by default, until what was ordered is over."""
        while True:
            status = self.call("status")
            if until(status):
                return status
            time.sleep(pause_s)

    def do(self, method, **params):
        """An order, and its end."""
        self.call(method, **params)
        status = self.wait()
        if status["job"] != "completed":
            raise Failed(f"{method}: {status['job']}: {(status['alarm'] or {}).get('text')}")
        return status
