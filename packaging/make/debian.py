"""Debian's packages, from the stage: the same programs as in the tarball."""
import datetime
import email.utils
import re
import shutil

from make.context import ARCHITECTURES, ROOT, WORK, fresh

MAINTAINER = "Servodrome developers <developers@servodrome.invalid>"


def changelog(context):
    date = email.utils.format_datetime(datetime.datetime.fromtimestamp(int(context.epoch), datetime.timezone.utc))
    return (f"servodrome ({context.version}-1) stable; urgency=medium\n\n  * The changes of each release are in CHANGELOG.md.\n\n"
            f" -- {MAINTAINER}  {date}\n")


def packages(context, architecture):
    """Builds the .deb files with debhelper, whose tools compute their dependencies and write the scripts of the service."""
    name, libraries, _ = ARCHITECTURES[architecture]
    for program, package in (("dh", "debhelper"), ("lintian", "lintian")):
        context.need(program, package)
    tree = fresh(WORK / "deb") / "servodrome"
    shutil.copytree(ROOT / "packaging/debian", tree / "debian")
    (tree / "debian/changelog").write_text(changelog(context))
    shutil.copy(ROOT / "packaging/systemd/servodrome.service", tree / "debian/servodrome.service")
    stage = context.stage(architecture)
    shutil.copytree(stage, tree / "stage", symlinks=True)
    # Debian has libraries in a folder for each architecture.
    library = tree / "stage/lib" / libraries
    library.mkdir(parents=True)
    for part in list((tree / "stage/lib").iterdir()):
        if part != library:
            part.rename(library / part.name)
    for file in library.rglob("*.pc"):
        text = re.sub(r"(?m)^prefix=.*", "prefix=/usr", file.read_text())
        file.write_text(re.sub(r"(?m)^libdir=.*", f"libdir=${{prefix}}/lib/{libraries}", text))
    context.run("dpkg-buildpackage", "--build=binary", "--no-sign", f"--host-arch={name}", "--no-check-builddeps", cwd=tree)
    built = sorted(tree.parent.glob("*.deb"))
    for old in context.dist.glob(f"*_{name}.deb"):
        old.unlink()
    for file in built:
        shutil.copy(file, context.dist / file.name)
    context.run("lintian", "--allow-root", "--fail-on", "error,warning", *built)
    return built
