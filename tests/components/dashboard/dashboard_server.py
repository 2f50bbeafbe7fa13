"""``dfvs-dashboard`` as a process that can be killed and started again."""

import dataclasses
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request

from loopback import free_tcp_port

STARTUP_S = 30.0


@dataclasses.dataclass
class Server:
    """``dfvs-dashboard`` on a port of its own; as a context it runs, and is killed at the end."""

    endpoints: list
    words: tuple = ()
    port: int = dataclasses.field(default_factory=free_tcp_port)
    process: subprocess.Popen | None = None
    tls: ssl.SSLContext | None = None

    @property
    def url(self):
        return f"{'http' if self.tls is None else 'https'}://127.0.0.1:{self.port}/"

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.kill()

    def start(self):
        command = [sys.executable, "-m", "dfvs_service.dashboard.cli", "--port", str(self.port)]
        links = [word for endpoint in self.endpoints for word in ("--connect", endpoint)]
        self.process = subprocess.Popen(
            [*command, *links, *self.words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + STARTUP_S
        while not self.answers():
            assert self.process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
        return self

    def answers(self):
        try:
            return urllib.request.urlopen(self.url, timeout=2.0, context=self.tls).status == 200
        except (urllib.error.URLError, TimeoutError):
            return False

    def kill(self):
        self.process.kill()
        self.process.wait()
