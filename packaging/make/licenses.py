"""What is in the packages beside our own code: components, with version and licence."""
import json

from make.context import ROOT, output_of

LICENCE_FILES = ("LICENSE", "LICENSE.md", "LICENSE.txt", "LICENCE", "LICENCE.md", "license", "license.md")


def parts_of_the_page():
    """The npm packages that the page's build may contain: those that are no tools of the developers."""
    lock = json.loads((ROOT / "studio/package-lock.json").read_text())
    for path, entry in sorted(lock["packages"].items()):
        if path and not entry.get("dev"):
            yield path.split("node_modules/")[-1], entry


def version_of(context, component):
    if "ziglang" in component:
        return output_of(context.zig() / "zig", "version")
    if "source" in component:
        return component["source"]["archive"].split("_")[1].split(".orig")[0]
    return output_of("dpkg-query", "-W", "-f=${Version}", component["debian"])


def text_of(context, component):
    if "ziglang" in component:
        return (context.zig() / "lib" / component["ziglang"] / component.get("file", "LICENSE.TXT")).read_text()
    with open(f"/usr/share/doc/{component['debian']}/copyright", encoding="utf-8") as file:
        return file.read()


def third_party(context, system):
    """The licences of all parts of a system's programs that ask for a notice, as one text."""
    texts = ["Servodrome's programs and its web page contain parts of other projects, under these licences.\n"]
    for name, component in sorted(context.components.items()):
        if component.get("notice", True) and component.get("system", system) == system:
            texts.append(heading(name, version_of(context, component), component["license"]) + text_of(context, component))
    for name, entry in parts_of_the_page():
        folder = ROOT / "studio/node_modules" / name
        files = [folder / file for file in LICENCE_FILES if (folder / file).is_file()]
        texts.append(heading(name, entry["version"], entry.get("license", "")) + (files[0].read_text() if files else
                     "The package has no text of its licence.\n"))
    return "\n".join(texts)


def heading(name, version, license_name):
    line = f"{name} {version} ({license_name})"
    return f"{line}\n{'=' * len(line)}\n\n"
