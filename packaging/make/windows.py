"""The program for Windows, in an archive as Windows opens it."""
import time
import zipfile

from make.archive import licences
from make.build import common_options, compile_and_install
from make.context import ROOT

NAME = "windows-x86_64"


def program(context):
    """Compiles the program, without the C interface, and installs it with the page into its stage."""
    settings = common_options(context, "x86_64-windows-gnu") | {"CMAKE_EXE_LINKER_FLAGS": "-s"}
    stage = compile_and_install(context, NAME, settings, ("servodrome",), ("program",))
    licences(context, stage / "share/doc/servodrome", "windows")


def archive(context):
    """Packs the stage, sorted and with one time, so that the same stage gives the same bytes."""
    stage = context.stage(NAME)
    name = f"servodrome-{context.version}-{NAME}"
    for old in context.dist.glob(f"servodrome-*-{NAME}.zip"):
        old.unlink()
    files = {path.relative_to(stage).as_posix(): path.read_bytes() for path in stage.rglob("*") if path.is_file()}
    files["README.md"] = (ROOT / "packaging/windows.md").read_text().replace("VERSION", context.version).encode()
    files["LICENSE.txt"] = (ROOT / "LICENSE").read_bytes()
    made = time.gmtime(int(context.epoch))[:6]
    with zipfile.ZipFile(context.dist / f"{name}.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(files):
            packed.writestr(zipfile.ZipInfo(f"{name}/{path}", made), files[path], zipfile.ZIP_DEFLATED)
