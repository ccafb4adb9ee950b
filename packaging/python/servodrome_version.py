"""The version of the wheel, for scikit-build-core: what tools/version prints."""
import pathlib
import subprocess


def dynamic_metadata(field, settings=None):
    if field != "version" or settings:
        raise ValueError("only the version is dynamic, and it has no settings")
    tool = pathlib.Path(__file__).resolve().parent.parent.parent / "tools" / "version"
    return subprocess.run([str(tool)], check=True, stdout=subprocess.PIPE, text=True).stdout.strip()
