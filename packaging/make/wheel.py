"""The Python wheel: one for every CPython, because it has no extension module."""
import shutil

from make.build import options
from make.context import OLDEST_GLIBC, ROOT, WORK, Failed, fresh


def wheel(context):
    """Builds the wheel with scikit-build-core in the x86_64 build folder, whose objects it finds there."""
    raw = fresh(WORK / "wheel")
    wanted = options(context, "x86_64") | {"SERVODROME_LICENCES": context.stage("x86_64") / "share/doc/servodrome/THIRD-PARTY.txt"}
    settings = [f"--config-settings=cmake.define.{name}={value}" for name, value in wanted.items()]
    context.run(context.python, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation",
                "--no-cache-dir", f"--config-settings=build-dir={WORK / 'x86_64'}", *settings, "--wheel-dir", raw, ROOT)
    (built,) = raw.glob("*.whl")
    platform = f"manylinux_{OLDEST_GLIBC.replace('.', '_')}_x86_64"
    repaired = fresh(WORK / "wheel-repaired")
    # auditwheel checks every ELF file against the policy, and gives the wheel its name.
    context.run(context.python, "-m", "auditwheel", "repair", "--plat", platform, "--only-plat", "--wheel-dir", repaired, built)
    (path,) = repaired.glob("*.whl")
    if not path.name.endswith(f"-py3-none-{platform}.whl"):
        raise Failed(f"the wheel is {path.name}, and should be for py3-none-{platform}")
    context.run(context.python, "-m", "twine", "check", "--strict", path)
    for old in context.dist.glob("servodrome-*.whl"):
        old.unlink()
    return shutil.copy(path, context.dist / path.name)
