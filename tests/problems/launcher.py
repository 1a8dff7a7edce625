"""A clone with scripts/fx, in which stand-ins take the place of all that it calls."""

import re
import shutil
import signal
import subprocess
from functools import partial
from pathlib import Path

import pytest

CLONE = Path(__file__).resolve().parents[2]

TOOLS = """awk bash cat cp cut df dirname env flock grep head id ls mkdir mktemp mv paste readlink
rm sed sh sha256sum sleep sort tail tar touch true uname xargs""".split()

#: What making a place takes: a call is counted, may take long, and may fail.
MAKING = """
echo call >>"$FAKES/calls"
echo "I: stand-in"
sleep "${FAKE_SECONDS:-0}"
[[ -z ${FAKE_FAILURE-} ]] || { echo "E: the mirror is gone"; exit 25; }
"""
# as root it makes the folder it is told; else it writes an archive
MMDEBSTRAP = (
    MAKING
    + """
for target; do [[ $target != */*.part && $target != - ]] || break; done
folder=$target
[[ $target != - ]] || folder=$(mktemp -d)
mkdir -p "$folder"/{usr,etc/ssl/certs,var} "$folder$FAKES" # for the marker
[[ $target != - ]] || tar -c -C "$folder" .
"""
)
# enters the root, where the marker is seen, or is told to do so by --root
UNSHARE = """
while [[ $1 == -* ]]; do
    [[ $1 != --root ]] || exec chroot "${@:2}"
    [[ $1 != --propagation ]] || shift
    shift
done
exec "$@"
"""
CHROOT = """
name=${1##*/}
export INSIDE=$$
echo "${name%%-*}" >"$FAKES/marker$INSIDE"
status=0
"${@:2}" || status=$?
rm -f "$FAKES/marker$INSIDE"
exit $status
"""
# answers the questions of the launcher, and makes a virtual environment with itself
PYTHON = (
    """
case "$*" in
-) cat >/dev/null ;;
"- "*) echo "a requirement" ;;
"-m venv "*) mkdir -p "$3/bin"; cp "$0" "$3/bin/python3"; echo "home = $3" >"$3/pyvenv.cfg" ;;
"-m pip "*) """
    + MAKING
    + """ ;;
esac
"""
)


class Launcher:
    """A clone with the launcher, a cache and stand-ins, all below paths with signs of shells."""

    def __init__(self, folder: Path):
        self.clone = folder / "a clone"
        self.fakes = folder / "fakes"
        self.cache = folder / "a & cache"
        self.elsewhere = folder / "else where"
        for place in (self.clone / "scripts", self.fakes, self.elsewhere):
            place.mkdir(parents=True)
        shutil.copy(CLONE / "pyproject.toml", self.clone)
        shutil.copytree(CLONE / "scripts/bin", self.clone / "scripts/bin")
        shutil.copy(CLONE / "scripts/debian-packages.txt", self.clone / "scripts")
        text = (CLONE / "scripts/fx").read_text()
        # inside a root the real marker would be seen; each start enters a root of its own
        mark = "marker=$FAKES/marker${INSIDE-}"
        text, count = re.subn(r"^marker=\S+", mark, text, flags=re.MULTILINE)
        assert count == 1
        self.fx = self.clone / "scripts/fx"
        self.fx.write_text(text)
        self.fx.chmod(0o755)
        for tool in TOOLS:
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
        for name, text in {
            "mmdebstrap": MMDEBSTRAP, "unshare": UNSHARE, "chroot": CHROOT,
            "newuidmap": "exit 0", "mount": "exit 0",
        }.items():  # fmt: skip
            self.fake(name, text)

    def python_for_wheels(self) -> None:
        """Put there what making a virtual environment takes."""
        self.fake("cc")
        self.fake("python3.13", PYTHON)

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
            # Shells let processes in the background ignore it, and so their children.
            preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        )

    def run(self, *command: str, **env: str) -> tuple[int, str, str]:
        """Run the launcher and return its status and what it wrote."""
        process = self.start(*command, **env)
        out, err = process.communicate(timeout=30)
        return process.returncode, out, err

    def calls(self) -> int:
        """How often a place was begun."""
        calls = self.fakes / "calls"
        return len(calls.read_text().split()) if calls.exists() else 0

    def places(self) -> list[str]:
        """List the folders in the cache, finished or not."""
        return sorted(path.name for path in self.cache.glob("*/*") if path.is_dir())
