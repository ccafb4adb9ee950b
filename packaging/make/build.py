"""The compiler, the headers of other libraries, the web page, and the programs of each architecture."""
import hashlib
import platform
import re
import shutil
import tarfile
from pathlib import Path

from make.context import ARCHITECTURES, OLDEST_GLIBC, ROOT, WORK, Failed, fresh


def programs(context):
    """Installs what packaging/requirements.txt lists into build/package/venv, if that has changed."""
    wanted = (ROOT / "packaging/requirements.txt").read_text()
    installed = WORK / "venv" / "requirements.installed"
    if installed.is_file() and installed.read_text() == wanted:
        return
    context.say("installing the compiler and other programs from PyPI")
    # Debian's own Python is the same in all runs, and its venv module is a package that may be missing.
    python = shutil.which("python3", path="/usr/bin") or "python3"
    context.run(python, "-m", "venv", "--clear", WORK / "venv")
    context.run(context.python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r",
                "packaging/requirements.txt")
    installed.write_text(wanted)


def debian_sources(kind):
    """The machine's own archives of Debian as a text for apt; kind is deb, or deb-src for source packages."""
    release = platform.freedesktop_os_release()["VERSION_CODENAME"]
    files = [Path("/etc/apt/sources.list"), *sorted(Path("/etc/apt/sources.list.d").glob("*"))]
    stanzas = []
    for file in (file for file in files if file.is_file()):
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        if file.suffix == ".sources":
            found = "\n".join(lines).split("\n\n")
            stanzas += [re.sub(r"(?m)^Types:.*", f"Types: {kind}", one) for one in found if re.search(rf"(?m)^Suites:.*\b{release}\b", one)]
        for line in (line for line in lines if file.suffix == ".list" and re.match(rf"deb\s+(\[.*?\]\s+)?\S+\s+{release}\s", line)):
            options, uri, suite, components = re.match(r"deb\s+(?:\[(.*?)\]\s+)?(\S+)\s+(\S+)\s+(.*)", line).groups()
            key = re.search(r"signed-by=(\S+)", options or "")
            stanzas.append(f"Types: {kind}\nURIs: {uri}\nSuites: {suite}\nComponents: {components}\n"
                           + (f"Signed-By: {key.group(1)}\n" if key else ""))
    if not stanzas:
        raise Failed(f"/etc/apt has no archive of Debian {release}, from which a source package could come")
    return "\n\n".join(stanzas) + "\n"


def source_archive(context, source):
    """The archive of a Debian source package: downloaded once, and checked."""
    folder = WORK / "downloads"
    folder.mkdir(exist_ok=True)
    archive = folder / source["archive"]
    if not archive.is_file():
        context.say(f"downloading the source of {source['package']} from Debian")
        lists = fresh(folder / "lists")
        (lists / "partial").mkdir()
        sources = folder / "source.sources"
        sources.write_text(debian_sources("deb-src"))
        apt = ["apt-get", "-o", f"Dir::Etc::sourcelist={sources}", "-o", "Dir::Etc::sourceparts=-", "-o",
               f"Dir::State::lists={lists}", "-o", "APT::Sandbox::User=", "-o", "pkgCacheFile=", "-o", "srcpkgCacheFile="]
        context.run(*apt, "update")
        context.run(*apt, "source", "--download-only", "--only-source", source["package"], cwd=folder)
    if not archive.is_file():
        raise Failed(f"apt-get source {source['package']} gave no {source['archive']}; is this Debian 12?")
    if hashlib.sha256(archive.read_bytes()).hexdigest() != source["sha256"]:
        raise Failed(f"{archive} has another checksum than in packaging/components.toml; remove it and try again")
    return archive


def dependencies(context):
    """A folder with the headers of the other libraries only: the compiler must not see the rest of /usr/include."""
    folder = fresh(context.dependencies)
    for name, component in context.components.items():
        for header in component.get("headers", []):
            path = f"/usr/include/{header}"
            if not Path(path).exists():
                raise Failed(f"{path} of {name} is missing; apt-get install {component['debian']}")
            (folder / header).symlink_to(path)
        if source := component.get("source"):
            with tarfile.open(source_archive(context, source)) as archive:
                for member in archive.getmembers():
                    if member.isfile() and member.name.startswith(source["folder"] + "/"):
                        (folder / member.name.rsplit("/", 1)[1]).write_bytes(archive.extractfile(member).read())


def page(context):
    """The web page, in build/studio."""
    context.run("tools/build-studio")
    if not (ROOT / "build/studio/index.html").is_file():
        raise Failed("the web page was not built: tools/build-studio says why")


def libgcc(architecture):
    """Debian's libgcc.a for an architecture."""
    triplet = ARCHITECTURES[architecture][1]
    folders = [f"/usr/lib/gcc/{triplet}/12", f"/usr/lib/gcc-cross/{triplet}/12"]
    for folder in folders:
        if Path(folder, "libgcc.a").is_file():
            return Path(folder, "libgcc.a")
    raise Failed(f"{' and '.join(folders)} have no libgcc.a; run tools/install-dependencies --packages")


def common_options(context, target):
    """CMake's options for a target of zig."""
    return {
        "CMAKE_TOOLCHAIN_FILE": ROOT / "cmake/toolchains/zig.cmake",
        "CMAKE_PROJECT_TOP_LEVEL_INCLUDES": ROOT / "cmake/toolchains/dependencies.cmake",
        "SERVODROME_ZIG": context.zig() / "zig",
        "SERVODROME_ZIG_TARGET": target,
        "SERVODROME_DEPENDENCIES": context.dependencies,
        "SERVODROME_VERSION": context.version,
        "SERVODROME_TESTS": "OFF",
        "SERVODROME_BENCH": "OFF",
        "SERVODROME_WERROR": "OFF",
        "CMAKE_BUILD_TYPE": "Release",
        # No path of this machine gets into the programs, so that every folder gives the same ones.
        "CMAKE_CXX_FLAGS_RELEASE": f"-O2 -DNDEBUG -ffile-prefix-map={ROOT}/=",
    }


def options(context, architecture):
    """CMake's options for an architecture of Linux."""
    return common_options(context, f"{architecture}-linux-gnu.{OLDEST_GLIBC}") | {
        "SERVODROME_LIBGCC": libgcc(architecture),
        "CMAKE_POSITION_INDEPENDENT_CODE": "ON",
        "CMAKE_EXE_LINKER_FLAGS": "-rtlib=none -s -pie -Wl,-z,now",
        "CMAKE_SHARED_LINKER_FLAGS": "-rtlib=none -s -Wl,-z,now",
        "CMAKE_INSTALL_LIBDIR": "lib",
    }


def compile_and_install(context, name, settings, targets, components):
    """Compiles targets in the folder build/package/NAME and installs components into the stage of that name."""
    folder = WORK / name
    context.say(f"compiling for {name}; this takes some minutes the first time")
    context.run("cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", *[f"-D{key}={value}" for key, value in settings.items()])
    context.run("cmake", "--build", folder, "--parallel", context.jobs, "--target", *targets)
    stage = fresh(context.stage(name))
    for component in components:
        context.run("cmake", "--install", folder, "--component", component, "--prefix", stage)
    return stage


def compile_for(context, architecture):
    """Compiles for an architecture of Linux and installs into its stage."""
    stage = compile_and_install(context, architecture, options(context, architecture), ("servodrome", "servodrome_capi"),
                                ("program", "interface"))
    if ARCHITECTURES[architecture][2]:
        # A program for another processor does not run here to write its manual page; the texts are the same.
        for text in ("man", "bash-completion", "zsh", "fish"):
            shutil.copytree(context.stage("x86_64") / "share" / text, stage / "share" / text)
