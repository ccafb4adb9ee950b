"""The container image: buildah builds packaging/container/Containerfile on a base that is made of Debian's packages."""
import gzip
import hashlib
import io
import json
import platform
import shutil
import tarfile

from make.build import debian_sources
from make.context import ROOT, WORK, fresh


def buildah(context, *arguments):
    """buildah with a store of its own. vfs and chroot need neither a file system nor a kernel's namespace of their own."""
    store = WORK / "containers"
    context.run("buildah", "--root", store / "root", "--runroot", store / "run", "--storage-driver", "vfs", *arguments)


def write_plain(built, path, epoch):
    """Copies the layers and the configuration of an image of buildah into an archive for docker and podman, without what is
    random: the names of the containers in which buildah has worked."""
    with tarfile.open(built) as source, path.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=0) as packed, tarfile.open(
            fileobj=packed, mode="w", format=tarfile.GNU_FORMAT) as archive:

        def add(name, size, content):
            entry = tarfile.TarInfo(name)
            entry.size, entry.mtime = size, int(epoch)
            archive.addfile(entry, content)

        def add_json(value, name=None):
            text = json.dumps(value, sort_keys=True).encode()
            name = name or f"{hashlib.sha256(text).hexdigest()}.json"
            add(name, len(text), io.BytesIO(text))
            return name

        (manifest,) = json.load(source.extractfile("manifest.json"))
        configuration = json.load(source.extractfile(manifest["Config"]))
        for name in ("container", "parent"):
            configuration.pop(name, None)
        for part in ("config", "container_config"):
            configuration[part]["Hostname"] = ""
        manifest["Config"] = add_json(configuration)
        for layer in manifest["Layers"]:
            add(layer, source.getmember(layer).size, source.extractfile(layer))
        add_json([manifest], "manifest.json")


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
    built = folder / "image.tar"
    buildah(context, "push", f"localhost/servodrome:{tag}", f"docker-archive:{built}:servodrome:{tag}")
    write_plain(built, path, context.epoch)
    built.unlink()
    return path
