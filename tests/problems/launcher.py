"""A clone with scripts/fx, in which stand-ins take the place of all that it calls."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

CLONE = Path(__file__).resolve().parents[2]

TOOLS = """awk bash cat cut df dirname env flock grep head ls mkdir mv paste readlink rm sed setpriv
setsid sh sha256sum sleep tail tar touch uname""".split()

# as root it makes the folder it is told; else it writes an archive
MMDEBSTRAP = """
echo call >>"$FAKES/calls"
echo "I: stand-in"
sleep "${FAKE_SECONDS:-0}"
[[ -z ${FAKE_FAILURE-} ]] || { echo "E: the mirror is gone"; exit 25; }
for target; do [[ $target != */*.part/root && $target != - ]] || break; done
folder=$target
[[ $target != - ]] || folder=$(mktemp -d)
mkdir -p "$folder"/{usr,etc/ssl/certs,var} "$folder$FAKES" # for the marker
[[ $target != - ]] || tar -c -C "$folder" .
"""
# like the real one it waits for its child and hands on the status
BWRAP = """
while [[ $1 != env && $1 != true ]]; do shift; done
echo "${FENICSX_SUITE:-trixie}" >"$FAKES/marker"
status=0
"$@" || status=$?
rm -f "$FAKES/marker"
exit $status
"""


class Launcher:
    """A clone with the launcher, a cache and stand-ins, all below paths with spaces."""

    def __init__(self, folder: Path):
        self.clone = folder / "a clone"
        self.fakes = folder / "fakes"
        self.cache = folder / "a cache"
        self.elsewhere = folder / "else where"
        for place in (self.clone / "scripts", self.fakes, self.elsewhere):
            place.mkdir(parents=True)
        shutil.copy(CLONE / "pyproject.toml", self.clone)
        shutil.copy(CLONE / "scripts/debian-packages.txt", self.clone / "scripts")
        text = (CLONE / "scripts/fx").read_text()
        # inside a root the real marker would be seen
        text, count = re.subn(r"^marker=\S+", "marker=$FAKES/marker", text, flags=re.MULTILINE)
        assert count == 1
        self.fx = self.clone / "scripts/fx"
        self.fx.write_text(text)
        self.fx.chmod(0o755)
        for tool in [*TOOLS, "mktemp"]:
            found = shutil.which(tool)
            if found is None:
                pytest.skip(f"{tool} is not installed")
            (self.fakes / tool).symlink_to(found)
        self.env = {
            "PATH": str(self.fakes),
            "FAKES": str(self.fakes),
            "HOME": str(folder),
            "XDG_CACHE_HOME": str(self.cache),
            "DISPLAY": ":0",
        }

    def fake(self, name: str, text: str = "exit 0") -> None:
        """Put a stand-in on the PATH."""
        path = self.fakes / name
        path.write_text(f"#!{shutil.which('bash')}\n{text}\n")
        path.chmod(0o755)

    def bootstrap_tools(self) -> None:
        """Put there what making and entering a root takes."""
        self.fake("mmdebstrap", MMDEBSTRAP)
        self.fake("bwrap", BWRAP)
        self.fake("newuidmap")
        self.fake("unshare", "exit 1")

    def start(self, *command: str, **env: str) -> subprocess.Popen[str]:
        """Start the launcher, from another folder."""
        return subprocess.Popen(
            [str(self.fx), *command],
            env=self.env | env,
            cwd=self.elsewhere,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def run(self, *command: str, **env: str) -> tuple[int, str, str]:
        """Run the launcher and return its status and what it wrote."""
        process = self.start(*command, **env)
        out, err = process.communicate(timeout=30)
        return process.returncode, out, err

    def calls(self) -> int:
        """How often mmdebstrap was started."""
        calls = self.fakes / "calls"
        return len(calls.read_text().split()) if calls.exists() else 0

    def roots(self) -> list[str]:
        """List the folders in the cache, finished or not."""
        return sorted(path.name for path in self.cache.glob("*/*") if path.is_dir())
