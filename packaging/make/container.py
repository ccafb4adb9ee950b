"""The container image: buildah builds packaging/container/Containerfile on a base that is made of Debian's packages."""
import gzip
import platform
import shutil

from make.build import debian_sources
from make.context import ROOT, WORK, fresh


def buildah(context, *arguments):
    """buildah with a store of its own. vfs and chroot need neither a file system nor a kernel's namespace of their own."""
    store = WORK / "containers"
    context.run("buildah", "--root", store / "root", "--runroot", store / "run", "--storage-driver", "vfs", *arguments)


def image(context):
    for program in ("buildah", "mmdebstrap"):
        context.need(program, program)
    folder = fresh(WORK / "container")
    context.say("making a base of Debian's packages")
    (folder / "debian.sources").write_text(debian_sources("deb"))
    release = platform.freedesktop_os_release()["VERSION_CODENAME"]
    context.run("mmdebstrap", "--variant=essential", "--format=tar", release, folder / "base.tar", folder / "debian.sources")
    (deb,) = context.dist.glob("servodrome_*_amd64.deb")
    shutil.copy(deb, folder / deb.name)
    (folder / "Base").write_text("FROM scratch\nADD base.tar /\n")
    fresh(WORK / "containers")
    common = ["--isolation", "chroot", "--network", "host", "--timestamp", context.epoch, "--pull-never", "--format", "docker"]
    buildah(context, "bud", *common, "--file", folder / "Base", "--tag", "servodrome-base", folder)
    (folder / "base.tar").unlink()
    tag = context.version.replace("+", "-")
    buildah(context, "bud", *common, "--build-arg", "BASE=localhost/servodrome-base", "--file", ROOT / "packaging/container/Containerfile",
            "--tag", f"servodrome:{tag}", folder)
    path = context.dist / f"servodrome-{context.version}-container-x86_64.tar.gz"
    for old in context.dist.glob("servodrome-*-container-x86_64.tar*"):
        old.unlink()
    plain = folder / "image.tar"
    buildah(context, "push", f"localhost/servodrome:{tag}", f"docker-archive:{plain}:servodrome:{tag}")
    with plain.open("rb") as unpacked, path.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=0) as packed:
        shutil.copyfileobj(unpacked, packed)
    plain.unlink()
    return path
