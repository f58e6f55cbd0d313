"""The record of a campaign: a folder with its specification and one row for each run.

Rows are in a SQLite file with a write-ahead log: others read it while it is written, and a row that was
written survives the end of this process by any signal. An Arrow stream is smaller and as safe, but it has no
index: to learn whether a run is there all of it has to be read, and what was asked for and has not run yet
needs a second file (``bench/explore.py`` measures both). Parquet, which other tools read, is made at the end.

Names of observables and requirements, and the values of variants, are stored once. A row keeps its
observables as 64-bit floats in the order of the table ``observables`` (little-endian, NaN where nothing was
observed), and its verdicts as a text with one of ``+-?.`` for each row of the table ``requirements``: met,
not met, not judged, no requirement of this variant.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import sys
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from math import isnan, nan
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from volery.base.errors import UsageError, VoleryError
from volery.base.files import replace_text
from volery.explore.points import CampaignRow, VariantPoint

SCHEMA: Final = "volery-campaign/1"
SPECIFICATION_FILE: Final = "campaign.json"
ROWS_FILE: Final = "rows.sqlite"
LOCK_FILE: Final = ".lock"

_TABLES = """
CREATE TABLE IF NOT EXISTS variants (id INTEGER PRIMARY KEY, point TEXT UNIQUE NOT NULL);
CREATE TABLE IF NOT EXISTS observables (id INTEGER PRIMARY KEY, name TEXT UNIQUE NOT NULL);
CREATE TABLE IF NOT EXISTS requirements (id INTEGER PRIMARY KEY, name TEXT UNIQUE NOT NULL);
CREATE TABLE IF NOT EXISTS runs (
    run INTEGER PRIMARY KEY, variant INTEGER NOT NULL, seed INTEGER NOT NULL,
    attempt INTEGER NOT NULL DEFAULT 0, status TEXT, reason TEXT, verdicts TEXT, observed BLOB,
    sim_s REAL, wall_s REAL, cpu_s REAL, host TEXT,
    UNIQUE (variant, seed));
"""
_SELECT = (
    "SELECT run, point, seed, attempt, status, reason, verdicts, observed, sim_s, wall_s, cpu_s, host "
    "FROM runs JOIN variants ON variants.id = runs.variant"
)
_SIGNS = {True: "+", False: "-", None: "?"}
_MET = {sign: met for met, sign in _SIGNS.items()}
_ABSENT = "."


class CampaignDiskError(VoleryError):
    """The folder of a campaign cannot be written any more; what was written is complete."""


class CampaignStore:
    """The folder of a campaign, for one writer or any number of readers.

    Args:
        folder: The folder.
        write: Whether this process writes. It creates what is missing and keeps other writers out.

    Raises:
        UsageError: The folder holds no campaign, another process writes it, or it cannot be written.
    """

    def __init__(self, folder: Path, *, write: bool = False) -> None:
        self.folder = folder
        self._lock = _locked(folder) if write else None
        path = folder / ROWS_FILE
        if not write and not path.exists():
            raise UsageError(f"{folder} holds no campaign: it has no {ROWS_FILE}; `volery explore` makes one")
        with self._guarded():
            self._rows = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            if write:
                self._rows.execute("PRAGMA journal_mode = WAL")
                self._rows.execute("PRAGMA synchronous = NORMAL")
                self._rows.executescript(_TABLES)
            else:
                self._rows.execute("PRAGMA query_only = ON")
        self._names: dict[str, dict[str, int]] = {"observables": {}, "requirements": {}}
        if not write:
            self.count()  # raises an error if this is no campaign, or none yet

    def close(self) -> None:
        """Close the files and let others write."""
        self._rows.close()
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    # -- the specification

    def specification(self) -> dict[str, Any]:
        """Return the specification as it was written; empty if there is none yet.

        Raises:
            UsageError: It cannot be read.
        """
        path = self.folder / SPECIFICATION_FILE
        try:
            found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            raise UsageError(f"{path} cannot be read: {error}") from error
        if found.get("schema") != SCHEMA:
            raise UsageError(f"{path} has schema {found.get('schema')!r}; this version reads {SCHEMA!r}")
        return found

    def write_specification(self, specification: Mapping[str, Any]) -> None:
        """Write the specification, which must hold values of JSON only."""
        text = json.dumps({"schema": SCHEMA, **specification}, indent=2, ensure_ascii=False)
        with self._guarded():
            replace_text(self.folder / SPECIFICATION_FILE, text + "\n")

    # -- writing

    def ask(self, points: Iterable[VariantPoint]) -> None:
        """Add runs for points that have none yet; they get the next numbers, in the order of *points*."""
        with self._guarded(), self._transaction():
            known: dict[str, int] = {}
            for point in points:
                variant = point.variant
                if variant not in known:
                    self._rows.execute("INSERT OR IGNORE INTO variants (point) VALUES (?)", (variant,))
                    found = self._rows.execute("SELECT id FROM variants WHERE point = ?", (variant,))
                    known = known if len(known) < _REMEMBERED else {}
                    known[variant] = found.fetchone()[0]
                self._rows.execute(
                    "INSERT OR IGNORE INTO runs (run, variant, seed) "
                    "SELECT COALESCE(MAX(run) + 1, 0), ?, ? FROM runs",
                    (known[variant], point.seed),
                )

    def record(self, rows: Sequence[CampaignRow], started: Sequence[int] = ()) -> None:
        """Write finished rows, and count an attempt of the runs that have *started*, in one transaction."""
        with self._guarded(), self._transaction():
            for row in rows:
                self._rows.execute(
                    "UPDATE runs SET status = ?, reason = ?, verdicts = ?, observed = ?, sim_s = ?, "
                    "wall_s = ?, cpu_s = ?, host = ?, attempt = MAX(attempt, ?) WHERE run = ?",
                    (
                        row.status,
                        row.reason,
                        self._verdicts(row.verdicts),
                        self._observed(row.observables),
                        row.sim_s,
                        row.wall_s,
                        row.cpu_s,
                        row.host,
                        row.attempt,
                        row.run,
                    ),
                )
            self._rows.executemany(
                "UPDATE runs SET attempt = attempt + 1 WHERE run = ?", [(run,) for run in started]
            )

    def _verdicts(self, verdicts: Mapping[str, bool | None]) -> str:
        places = self._places("requirements", verdicts)
        met = {places[name]: _SIGNS[one] for name, one in verdicts.items()}
        return "".join(met.get(place, _ABSENT) for place in range(max(met, default=-1) + 1))

    def _observed(self, observables: Mapping[str, float]) -> bytes:
        places = self._places("observables", observables)
        values = array("d", [nan]) * (max((places[name] for name in observables), default=-1) + 1)
        for name, value in observables.items():
            values[places[name]] = value
        return values.tobytes()

    def _places(self, table: str, wanted: Iterable[str]) -> dict[str, int]:
        """Return the places of names in rows; names that are new get one."""
        known = self._names[table]
        if any(name not in known for name in wanted):
            self._rows.executemany(
                f"INSERT OR IGNORE INTO {table} (name) VALUES (?)",
                [(name,) for name in wanted if name not in known],
            )
            known.update(self._read_names(table))
        return known

    def _read_names(self, table: str) -> dict[str, int]:
        found = self._query(f"SELECT name, id FROM {table} ORDER BY id")
        return {name: place - 1 for name, place in found}

    # -- reading

    def count(self) -> tuple[int, int]:
        """Return how many runs were asked for, and how many of them are finished."""
        asked, finished = self._query("SELECT COUNT(*), COUNT(status) FROM runs").fetchone()
        return asked, finished

    def statuses(self) -> dict[str, int]:
        """Return how many finished runs have each status."""
        found = self._query("SELECT status, COUNT(*) FROM runs WHERE status NOT NULL GROUP BY status")
        return dict(found.fetchall())

    def find(self, point: VariantPoint) -> CampaignRow | None:
        """Return the row of a point; None if its run is not finished."""
        where = " WHERE point = ? AND seed = ? AND status NOT NULL"
        return next(self._read(_SELECT + where, (point.variant, point.seed)), None)

    def row(self, run: int) -> CampaignRow | None:
        """Return the row of a run, its status empty if it is not finished; None if there is no such run."""
        return next(self._read(_SELECT + " WHERE run = ?", (run,)), None)

    def rows(self) -> Iterator[CampaignRow]:
        """Yield the finished rows in the order of their runs, without holding all of them."""
        yield from self._read(_SELECT + " WHERE status NOT NULL ORDER BY run", ())

    def unfinished(
        self, points: Iterable[VariantPoint] | None = None
    ) -> Iterator[tuple[int, int, VariantPoint]]:
        """Yield run, attempts so far and point of what is not finished; by default of all that was asked."""
        if points is None:
            after = -1
            while True:  # in parts: the table is written meanwhile
                found = self._query(
                    "SELECT run, attempt, point, seed FROM runs JOIN variants ON variants.id = runs.variant "
                    "WHERE status IS NULL AND run > ? ORDER BY run LIMIT 1000",
                    (after,),
                ).fetchall()
                for run, attempt, variant, seed in found:
                    yield run, attempt, VariantPoint(json.loads(variant), seed)
                if not found:
                    return
                after = found[-1][0]
        for point in points:
            found = self._query(
                "SELECT run, attempt FROM runs JOIN variants ON variants.id = runs.variant "
                "WHERE point = ? AND seed = ? AND status IS NULL",
                (point.variant, point.seed),
            ).fetchall()
            for run, attempt in found:
                yield run, attempt, point

    def _read(self, query: str, values: tuple[Any, ...]) -> Iterator[CampaignRow]:
        names = {table: list(self._read_names(table)) for table in self._names}
        for found in self._query(query, values):
            run, variant, seed, attempt, status, reason, verdicts, observed, sim_s, wall_s, cpu_s, host = (
                found
            )
            numbers = array("d", observed or b"")
            yield CampaignRow(
                run,
                VariantPoint(json.loads(variant), seed),
                status or "",
                reason or "",
                {
                    name: _MET[sign]
                    for name, sign in zip(names["requirements"], verdicts or "", strict=False)
                    if sign != _ABSENT
                },
                {
                    name: number
                    for name, number in zip(names["observables"], numbers, strict=False)
                    if not isnan(number)
                },
                sim_s or 0.0,
                wall_s or 0.0,
                cpu_s or 0.0,
                host or "",
                attempt,
            )

    def kinds(self) -> dict[str, type[Any]]:
        """Return, by path, the type that holds all values of the points: bool, int, float or str."""
        found: dict[str, set[type[Any]]] = {}
        for (text,) in self._query("SELECT point FROM variants ORDER BY id"):
            for path, value in json.loads(text).items():
                found.setdefault(path, set()).add(type(value))
        return {path: _common(kinds) for path, kinds in found.items()}

    def columns(self, paths: Iterable[str], after: int = -1, most: int = -1) -> dict[str, Any]:
        """Return finished rows as columns by name: numpy arrays of numbers, lists of texts.

        The values of points have their path as name, with ``set.`` before it, verdicts ``met.`` before the
        name of the requirement; observables have their own names.

        Args:
            paths: Values of points that get a column, such as all ``kinds``.
            after: Only runs with a greater number.
            most: Number of rows at most; -1 for all.
        """
        where = "FROM runs WHERE status NOT NULL AND run > ?"
        (rows,) = self._query(f"SELECT COUNT(*) FROM (SELECT 1 {where} LIMIT ?)", (after, most)).fetchone()
        observables = list(self._read_names("observables"))
        requirements = list(self._read_names("requirements"))
        numbers = np.full((len(observables), rows), nan)
        times = np.zeros((3, rows))
        whole = np.zeros((3, rows), dtype=np.int64)
        texts: tuple[list[str], ...] = ([], [], [], [])
        variants: list[int] = []
        found = self._query(
            "SELECT run, seed, attempt, status, reason, host, verdicts, variant, sim_s, wall_s, cpu_s, "
            f"observed {where} ORDER BY run LIMIT ?",
            (after, rows),
        )
        for place, row in enumerate(found):
            whole[:, place] = row[:3]
            for column, text in zip(texts, row[3:7], strict=True):
                column.append(sys.intern(text))
            variants.append(row[7])
            times[:, place] = row[8:11]
            observed = np.frombuffer(row[11])
            numbers[: len(observed), place] = observed
        values = {}
        for one in dict.fromkeys(variants):
            (text,) = self._query("SELECT point FROM variants WHERE id = ?", (one,)).fetchone()
            values[one] = json.loads(text)
        return {
            "run": whole[0],
            "seed": whole[1],
            **{f"set.{path}": [values[variant].get(path) for variant in variants] for path in paths},
            "status": texts[0],
            "reason": texts[1],
            **{
                f"met.{name}": [_MET.get(one[place : place + 1]) for one in texts[3]]
                for name, place in sorted(zip(requirements, count(), strict=False))
            },
            **{name: numbers[place] for name, place in sorted(zip(observables, count(), strict=False))},
            "sim_s": times[0],
            "wall_s": times[1],
            "cpu_s": times[2],
            "host": texts[2],
            "attempt": whole[2],
        }

    # -- errors

    def _query(self, query: str, values: tuple[Any, ...] = ()) -> sqlite3.Cursor:
        """Read. Raises ``UsageError`` if the file cannot be read."""
        try:
            return self._rows.execute(query, values)
        except sqlite3.Error as error:
            raise UsageError(f"{self.folder / ROWS_FILE} cannot be read: {error}") from error

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._rows.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._rows.execute("COMMIT")
        except BaseException:
            if self._rows.in_transaction:
                self._rows.execute("ROLLBACK")
            raise

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise CampaignDiskError(
                f"{self.folder} cannot be written: {why}. What was written is complete; when there is room "
                "again, the same command resumes the campaign"
            ) from error


_REMEMBERED = 10_000
"""Variants whose numbers are kept while points are added."""


def _common(kinds: set[type[Any]]) -> type[Any]:
    """Return the type that holds values of all *kinds*."""
    kinds = kinds - {type(None)}
    if len(kinds) == 1 and kinds <= {bool, int, float}:
        return next(iter(kinds))
    return float if kinds and kinds <= {int, float} else str


def _locked(folder: Path) -> IO[bytes]:
    """Create the folder if it is missing, and keep other writers out until the file is closed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_FILE).open("ab")
    except OSError as error:
        raise UsageError(
            f"cannot write into {folder}: {error.strerror or error}; choose another folder"
        ) from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise UsageError(f"{folder}: another process writes this campaign; wait for it or stop it") from None
    os.set_inheritable(file.fileno(), False)
    return file
