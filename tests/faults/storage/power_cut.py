"""What a disk holds after a power cut, from the trace of a process' system calls.

The model is stricter than any file system we know: what was written to a file counts once that
file was synced, a name once its directory was. `strict` drops everything else. `torn` keeps any of
the unsynced 4 KiB pages by the toss of a coin, and of each directory any number of its first
unsynced changes. A sync that failed has lost what it should have written, as Linux does it: the
pages are taken for clean, and a later sync does not bring them.
"""

from __future__ import annotations

import random
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

TRACED = (
    "openat,write,pwrite64,ftruncate,fallocate,fsync,fdatasync,rename,renameat,renameat2,link,"
    "linkat,unlink,unlinkat,mkdir,mkdirat,sendto"
)
PAGE = 4096

_CALL = re.compile(r"^(?:(\d+) +)?(\w+)\((.*)\) += (-?\d+)(.*)$", re.DOTALL)
_UNFINISHED = re.compile(r"^(?:(\d+) +)?(\w+)\((.*) <unfinished \.\.\.>$", re.DOTALL)
_RESUMED = re.compile(r"^(?:(\d+) +)?<\.\.\. (\w+) resumed>(.*)$", re.DOTALL)
_QUOTED = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')
_FD = re.compile(r"^\d+<([^>]*)>")


def strace(output: Path, *options: str) -> list[str]:
    """Return the command that traces what follows it; with ``-D`` it is nobody's parent."""
    return [
        "strace", "-f", "-y", "-xx", "-s", "20000000", "--seccomp-bpf", "-qq",
        "-e", "signal=none", "-e", f"trace={TRACED}", *options, "-o", str(output),
    ]  # fmt: skip


def settled(trace: Path) -> Path:
    """Return a trace once its tracer, which outlives what it traced, has written the end of it."""
    size = -1
    while size != (size := trace.stat().st_size):
        time.sleep(0.5)
    return trace


@dataclass(frozen=True)
class Call:
    """One system call; ``began`` and ``ended`` are places in the trace."""

    name: str
    arguments: str
    result: int
    began: int
    ended: int

    @property
    def texts(self) -> list[bytes]:
        """The strings among the arguments."""
        return [bytes.fromhex(t.replace("\\x", "")) for t in _QUOTED.findall(self.arguments)]

    @property
    def file(self) -> str:
        """The file behind the descriptor that is the first argument."""
        found = _FD.match(self.arguments)
        text = found[1] if found else ""
        if text.startswith("\\x"):
            text = bytes.fromhex(text.replace("\\x", "")).decode()
        return text

    def number(self, place: int) -> int:
        """An argument counted from the end, -1 the last."""
        return int(self.arguments.rsplit(",", -place)[place].strip(), 0)


def calls(trace: Path) -> Iterator[Call]:
    """Yield the calls of a trace in the order of their ends; a send counts from its beginning."""
    began: dict[str, tuple[int, str, str]] = {}
    with trace.open(encoding="ascii", errors="replace") as lines:
        for place, raw in enumerate(lines):
            line = raw.rstrip("\n")
            if found := _UNFINISHED.match(line):
                began[found[1]] = (place, found[2], found[3])
                if found[2] == "sendto":
                    yield Call("sendto", found[3], 0, place, place)
            elif found := _RESUMED.match(line):
                first, name, arguments = began.pop(found[1])
                whole = _CALL.match(f"{name}({arguments}{found[3]}")
                if whole and name != "sendto":
                    yield Call(name, whole[3], int(whole[4]), first, place)
            elif found := _CALL.match(line):
                yield Call(found[2], found[3], int(found[4]), place, place)


@dataclass
class _File:
    durable: bytearray = field(default_factory=bytearray)
    pending: list[tuple[int, int, bytes | None]] = field(default_factory=list)
    offset: int = 0

    def apply(self, change: tuple[int, int, bytes | None], content: bytearray) -> None:
        _, at, data = change
        if data is None:  # a new size
            content[:] = content[:at].ljust(at, b"\0")
            return
        content[:] = content.ljust(at, b"\0")
        content[at : at + len(data)] = data


class Disk:
    """A folder as a disk would hold it.

    Parameters
    ----------
    root : Path
        The folder; what it holds now counts as durable.
    """

    def __init__(self, root: Path) -> None:
        self.root = str(root)
        self._names: dict[str, _File] = {}
        for path in root.rglob("*"):
            if path.is_file():
                self._names[str(path)] = _File(bytearray(path.read_bytes()))
        self._durable = dict(self._names)
        self._changes: dict[str, list[tuple[int, dict[str, _File | None]]]] = {}

    def play(self, call: Call) -> bool:
        """Let a call take effect; return whether it changed anything here."""
        if call.name in ("fsync", "fdatasync"):
            return self._sync(call)
        if call.result < 0:
            return False
        if call.name in ("write", "pwrite64", "ftruncate", "fallocate"):
            return self._write(call)
        return self._rename(call)

    def _write(self, call: Call) -> bool:
        file = self._names.get(call.file)
        if file is None or call.file.endswith("-shm"):
            return False
        if call.name == "write":
            data, at = call.texts[0], file.offset
            file.offset += call.result
            self._split(file, call.ended, at, data[: call.result])
        elif call.name == "pwrite64":
            self._split(file, call.ended, call.number(-1), call.texts[0][: call.result])
        elif call.name == "ftruncate":
            file.pending.append((call.ended, call.number(-1), None))
        else:
            file.pending.append((call.ended, call.number(-2) + call.number(-1), None))
        return True

    @staticmethod
    def _split(file: _File, place: int, at: int, data: bytes) -> None:
        first = PAGE - at % PAGE
        for start, stop in zip(
            (0, *range(first, len(data), PAGE)),
            (*range(first, len(data), PAGE), len(data)),
            strict=True,
        ):
            file.pending.append((place, at + start, data[start:stop]))

    def _sync(self, call: Call) -> bool:
        path = call.file
        if path in self._names:
            file = self._names[path]
            late = [change for change in file.pending if change[0] > call.began]
            for change in file.pending:
                if change[0] <= call.began and call.result == 0:
                    file.apply(change, file.durable)
            file.pending = late
            return True
        changes = self._changes.get(path)
        if changes is None or call.result < 0:
            return changes is not None
        for place, change in changes:
            if place <= call.began:
                self._take(change, self._durable)
        self._changes[path] = [one for one in changes if one[0] > call.began]
        return True

    def _rename(self, call: Call) -> bool:
        names = [text.decode(errors="replace") for text in call.texts]
        if not names or not names[-1].startswith(self.root):
            return False
        change: dict[str, _File | None] = {}
        if call.name == "openat":
            if "O_CREAT" not in call.arguments and "O_TRUNC" not in call.arguments:
                return False
            if names[0] in self._names:
                self._names[names[0]].offset = 0
                return False
            change = {names[0]: _File()}
        elif call.name.startswith("rename"):
            change = {names[1]: self._names[names[0]], names[0]: None}
        elif call.name.startswith("link"):
            change = {names[1]: self._names[names[0]]}
        elif call.name.startswith("unlink"):
            change = {names[0]: None}
        self._take(change, self._names)
        folder = str(Path(names[-1]).parent)
        self._changes.setdefault(folder, []).append((call.ended, change))
        return bool(change)

    @staticmethod
    def _take(change: dict[str, _File | None], names: dict[str, _File]) -> None:
        for name, file in change.items():
            if file is None:
                names.pop(name, None)
            else:
                names[name] = file

    def after_power_cut(self, folder: Path, torn: random.Random | None) -> None:
        """Write into a new folder what would be there; ``torn`` tosses the coins."""
        names = dict(self._durable)
        if torn is not None:
            for changes in self._changes.values():
                for _, change in changes[: torn.randint(0, len(changes))]:
                    self._take(change, names)
        for name, file in names.items():
            if name.endswith("-shm"):
                continue  # shared memory, rebuilt by whoever opens the index first
            content = bytearray(file.durable)
            for change in file.pending if torn is not None else ():
                if torn is not None and torn.random() < 0.5:
                    file.apply(change, content)
            path = folder / Path(name).relative_to(self.root)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
