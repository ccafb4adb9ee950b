"""Programs for Windows under wine64, and a line of drives in one."""

import os
import pathlib
import pty
import shutil
import subprocess
import termios
import threading
import tty

import line

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = pathlib.Path(
    os.environ.get("SERVODROME_WINDOWS") or ROOT / "build/package/stage-windows-x86_64/bin/servodrome.exe"
)
# Debian's package wine64 installs the program into this folder, which is not in PATH.
WINE = shutil.which("wine64") or shutil.which("wine64", path="/usr/lib/wine")
PREPARATION = 300  # timeout in seconds; it usually takes ten


class Wine:
    """A Wine environment in `folder`, until close()."""

    def __init__(self, folder):
        self.folder = folder
        self.environment = os.environ | {
            "WINEPREFIX": str(folder),
            "WINEDEBUG": "-all",
            # Wine offers to download two programs for .NET and HTML; they are not needed.
            "WINEDLLOVERRIDES": "mscoree,mshtml=",
        }
        self.environment.pop("DISPLAY", None)
        self.run("wineboot", "--init")

    def start(self, *command, **options):
        return subprocess.Popen(
            [WINE, *map(str, command)], env=self.environment, stdin=subprocess.DEVNULL, **options
        )

    def run(self, *command, status=0, **options):
        """Runs a command to its end; returns its standard output or its error message."""
        process = self.start(*command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
        try:
            output, errors = process.communicate(timeout=PREPARATION)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        assert process.returncode == status, f"{command}: {process.returncode}\n{output}{errors}"
        return errors if status else output

    def connect_port(self, name, device):
        """Makes the tty `device` the COM port `name`, for programs that start from now on."""
        self.run("reg", "add", r"HKLM\Software\Wine\Ports", "/v", name, "/d", device, "/f")
        self.stop_server()

    def stop_server(self):
        server = pathlib.Path(WINE).with_name("wineserver")
        for option in ("-k", "-w"):  # ends all programs; waits until they have ended
            subprocess.run([server, option], env=self.environment, capture_output=True, check=False, timeout=60)

    close = stop_server


class Cable:
    """Two ttys that are connected like the ends of a null modem cable: `one` and `other`."""

    def __init__(self):
        self.descriptors = []
        self.names = []
        for _ in range(2):
            master, slave = pty.openpty()
            tty.setraw(slave, termios.TCSANOW)
            self.descriptors += [master, slave]  # the slaves stay open, so that programs can open and close the ends
            self.names.append(os.ttyname(slave))
        self.one, self.other = self.names
        for source, target in ((0, 2), (2, 0)):
            ends = self.descriptors[source], self.descriptors[target]
            threading.Thread(target=self.carry, args=ends, daemon=True).start()

    @staticmethod
    def carry(source, target):
        try:
            while data := os.read(source, 4096):
                os.write(target, data)
        except OSError:  # the other end is closed
            pass


class WindowsLine(line.Line):
    """Runs `servodrome.exe up` under wine, until stop(); wine converts SIGINT to Ctrl-C."""

    def __init__(self, wine, folder, text, arguments=()):
        self.folder = pathlib.Path(folder)
        (self.folder / "line.toml").write_text(text)
        ready = self.folder / "ready.json"
        self.output = self.folder / "output"
        with open(self.output, "wb") as output:
            self.process = wine.start(
                PROGRAM, "up", "line.toml", "--api", "127.0.0.1:0", "--ready-file", "ready.json", *arguments,
                cwd=folder, stdout=output, stderr=subprocess.STDOUT,
            )
        self.wait_until_ready(ready)
