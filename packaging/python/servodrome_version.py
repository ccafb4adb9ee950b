"""The version of the wheel, for scikit-build-core: what tools/version prints."""
import pathlib
import subprocess


def dynamic_metadata(settings, _project):
    if settings:
        raise ValueError("the version has no settings")
    tool = pathlib.Path(__file__).resolve().parent.parent.parent / "tools" / "version"
    return {"version": subprocess.run([str(tool)], check=True, stdout=subprocess.PIPE, text=True).stdout.strip()}
