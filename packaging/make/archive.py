"""The tarball of an architecture."""
import gzip
import shutil
import tarfile

from make.context import ROOT
from make.licenses import third_party


def licences(context, folder, system):
    """Copies the licences and what changed into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("LICENSE", "CHANGELOG.md"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "THIRD-PARTY.txt").write_text(third_party(context, system))


def documents(context, stage):
    """Adds to the stage what every package has: licences, what changed, and the script for continuous integration."""
    licences(context, stage / "share/doc/servodrome", "linux")
    tools = stage / "share/servodrome"
    tools.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "packaging/ci/servodrome-ci", tools / "servodrome-ci")
    shutil.copy(ROOT / "packaging/systemd/servodrome.service", tools / "servodrome.service")


def name_of(context, architecture):
    return f"servodrome-{context.version}-linux-{architecture}"


def tarball(context, architecture):
    """Packs the stage, sorted, with one owner and one time, so that the same stage gives the same bytes."""
    name = name_of(context, architecture)
    stage = context.stage(architecture)
    readme = stage.parent / "tarball.md"
    readme.write_text((ROOT / "packaging/tarball.md").read_text().replace("VERSION", context.version))
    for old in context.dist.glob(f"servodrome-*-linux-{architecture}.tar.gz"):
        old.unlink()
    path = context.dist / f"{name}.tar.gz"

    def plain(entry):
        entry.uid = entry.gid = 0
        entry.uname = entry.gname = "root"
        entry.mtime = int(context.epoch)
        return entry

    with path.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=0) as packed, tarfile.open(
            fileobj=packed, mode="w", format=tarfile.GNU_FORMAT) as archive:
        for source in [stage, *sorted(stage.rglob("*"))]:
            inside = f"{name}/{source.relative_to(stage)}" if source != stage else name
            archive.add(source, inside, recursive=False, filter=plain)
        archive.add(readme, f"{name}/README.md", filter=plain)
        archive.add(ROOT / "LICENSE", f"{name}/LICENSE", filter=plain)
    return path
