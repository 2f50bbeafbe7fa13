"""Our commands as a user starts them, and what belongs to a start: processes, ports, folders."""

import contextlib
import os
import secrets
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import psutil
from waiting import until

START_S, END_S = 60.0, 15.0
_POLL_S = 0.05
_MARK = "DFVS_TEST_START"
_LAUNCH = """
import os, signal, subprocess, sys
from dfvs_common.lifecycle import child_environment
for number in (signal.SIGHUP, signal.SIGINT):  # nohup and shells have them ignored
    signal.signal(number, signal.SIG_DFL)
environment = os.environ | child_environment()
command = subprocess.Popen(sys.argv[1:], stdout=sys.stderr, env=environment)
print(command.pid, flush=True)
sys.exit(command.wait())
"""


@dataclass(frozen=True)
class Command:
    """Words after ``python -m``, and what shows that the command is at work.

    ``says`` is in its output then; ``runs`` is in the command line of one of its processes, and
    ``loads`` in the name of a file that one has mapped.
    """

    words: tuple
    says: str = ""
    runs: str = ""
    loads: str = ""


class Started:
    """One start of a command, below a launcher, which may be killed, in a folder of its own."""

    def __init__(self, command, folder):
        self.command, self._mark = command, secrets.token_hex(16)
        self.temporary = folder / "tmp"
        self.temporary.mkdir(parents=True)
        self._output = folder / "output"
        environment = {_MARK: self._mark, "TMPDIR": str(self.temporary)}
        with self._output.open("wb") as output:
            self._launcher = subprocess.Popen(
                [sys.executable, "-c", _LAUNCH, sys.executable, "-m", *command.words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=output,
                cwd=folder,
                env=os.environ | environment,
                start_new_session=True,
            )
        self.pid = int(self._launcher.stdout.readline())
        self.ports = set()

    @property
    def output(self):
        return self._output.read_text(errors="replace")

    def processes(self):
        """All that run and came of this start, however they were started, but for the launcher."""
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                is_ours = process.environ().get(_MARK) == self._mark
                is_other = process.pid != self._launcher.pid
                if is_ours and is_other and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
        return found

    def _is_at_work(self):
        if self.command.says not in self.output:
            return False
        found = self.processes()
        runs = any(self.command.runs in " ".join(_words(p)) for p in found)
        return runs and any(self.command.loads in _maps(p) for p in found)

    def await_work(self):
        """Wait until the command works, and note what it has."""
        assert until(self._is_at_work, START_S, _POLL_S), self.output
        for process in self.processes():
            with contextlib.suppress(psutil.Error):
                bound = [c for c in process.net_connections("inet") if not c.raddr]
                self.ports |= {(c.type, c.laddr.port) for c in bound}

    def end(self, how):
        """Send a signal to the command, or kill what started it; the exit code, where there is."""
        if how == "parent":
            self._launcher.kill()
        else:
            os.kill(self.pid, getattr(signal, how))
        has_ended = until(lambda: not self.processes(), END_S, _POLL_S)
        assert has_ended, [_words(p) for p in self.processes()]
        return self._launcher.wait(END_S)

    def left_ports(self):
        """Ports that it had and that cannot be bound again."""
        return {port for kind, port in self.ports if not _can_bind(kind, port)}

    def left_files(self):
        return sorted(path.name for path in self.temporary.iterdir())

    def close(self):
        """Kill what is left."""
        for process in self.processes():
            with contextlib.suppress(psutil.Error):
                process.kill()
        self._launcher.kill()
        self._launcher.communicate()


def _words(process):
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def _maps(process):
    try:
        return Path(f"/proc/{process.pid}/maps").read_text()
    except OSError:
        return ""


def _can_bind(kind, port):
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def zenoh_words(endpoint):
    return ("--set", f'zenoh.listen=["{endpoint}"]')
