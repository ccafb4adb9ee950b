"""What all steps of tools/package share: folders, the version, the time of the commit, and how a command runs."""
import fcntl
import os
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
WORK = ROOT / "build" / "package"
OLDEST_GLIBC = "2.28"
# Architecture: name of Debian, folder of Debian's libraries, emulator of qemu-user.
ARCHITECTURES = {
    "x86_64": ("amd64", "x86_64-linux-gnu", None),
    "aarch64": ("arm64", "aarch64-linux-gnu", "qemu-aarch64-static"),
}


class Failed(Exception):
    """A step cannot go on: the message says why, and what to do."""


def output_of(*command, **options):
    """Standard output of a command, without spaces at its end."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT, **options).stdout.strip()


class Context:
    def __init__(self, dist, jobs):
        self.dist = dist
        self.jobs = jobs
        self.version = output_of("tools/version")
        self.number = self.version.split("+")[0]
        # The time of all files in the packages: that of the commit. Tools that make archives know this variable.
        self.epoch = os.environ.get("SOURCE_DATE_EPOCH") or output_of("git", "log", "-1", "--format=%ct")
        self.environment = os.environ | {
            "SOURCE_DATE_EPOCH": self.epoch,
            "PATH": f"{WORK / 'venv/bin'}:{os.environ['PATH']}",
            "LC_ALL": "C.UTF-8",
            "TZ": "UTC",
            "PYTHONDONTWRITEBYTECODE": "1",
            "ZIG_GLOBAL_CACHE_DIR": str(WORK / "zig-cache"),
            "ZIG_LOCAL_CACHE_DIR": str(WORK / "zig-cache"),
        }
        self.components = tomllib.loads((ROOT / "packaging/components.toml").read_text())
        self.started = time.monotonic()
        os.umask(0o022)  # the modes of files in the packages
        WORK.mkdir(parents=True, exist_ok=True)
        dist.mkdir(parents=True, exist_ok=True)
        # Two runs would replace each other's files. The lock ends with the process.
        self.lock = (WORK / "lock").open("w")
        try:
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Failed("another tools/package runs in this folder; wait for its end") from None

    @property
    def python(self):
        return WORK / "venv" / "bin" / "python"

    @property
    def dependencies(self):
        return WORK / "dependencies"

    def stage(self, architecture):
        """The installed tree of an architecture, from which the packages are made."""
        return WORK / f"stage-{architecture}"

    def zig(self):
        return Path(output_of(self.python, "-c", "import ziglang, os; print(os.path.dirname(ziglang.__file__))"))

    def say(self, text):
        print(f"package: {time.monotonic() - self.started:6.1f} s  {text}", flush=True)

    def run(self, *command, cwd=ROOT, **options):
        """Runs a command; its output goes into build/package/log and is shown only if it fails."""
        command = [str(part) for part in command]
        log = WORK / "log"
        with log.open("wb") as out:
            done = subprocess.run(command, cwd=cwd, env=self.environment, stdin=subprocess.DEVNULL, stdout=out,
                                  stderr=subprocess.STDOUT, check=False, **options)
        if done.returncode != 0:
            sys.stderr.write(log.read_text(errors="replace")[-20_000:])
            raise Failed(f"this command ended with {done.returncode}: {' '.join(command)}")

    def need(self, program, package):
        if shutil.which(program) is None:
            raise Failed(f"{program} is missing; run tools/install-dependencies --packages, or apt-get install {package}")


def fresh(folder):
    """An empty folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
