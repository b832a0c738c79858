"""TextGrids of every form that Praat writes, made from tiers."""

import json
import struct

PHONES = [("sil", 0.0, 0.2), ("AA1", 0.2, 0.5), ("P", 0.5, 0.7), ("AE1", 0.7, 0.9), ("sil", 0.9, 1.0)]
WORDS = [("op", 0.2, 0.7), ("a", 0.7, 0.9)]


def shifted(tier, by_s):
    return [(label, start + by_s, end + by_s) for label, start, end in tier]


def quoted(text):
    return '"' + text.replace('"', '""') + '"'


def long_grid(tiers, start=0.0, end=1.0, points=()):
    """The long form; points: names of tiers whose entries are (mark, time, time)."""
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", f"xmin = {start!r} ", f"xmax = {end!r} "]
    lines += ["tiers? <exists> ", f"size = {len(tiers)} ", "item []: "]
    for number, (name, entries) in enumerate(tiers, start=1):
        kind = "points" if name in points else "intervals"
        lines += [f"    item [{number}]:", f'        class = "{"TextTier" if name in points else "IntervalTier"}" ']
        lines += [f"        name = {quoted(name)} ", f"        xmin = {start!r} ", f"        xmax = {end!r} "]
        lines.append(f"        {kind}: size = {len(entries)} ")
        for index, (label, begin, stop) in enumerate(entries, start=1):
            lines.append(f"        {kind} [{index}]:")
            if name in points:
                lines += [f"            number = {begin!r} ", f"            mark = {quoted(label)} "]
            else:
                lines += [
                    f"            xmin = {begin!r} ",
                    f"            xmax = {stop!r} ",
                    f"            text = {quoted(label)} ",
                ]
    return "\n".join(lines) + "\n"


def short_grid(tiers, start=0.0, end=1.0):
    lines = ['File type = "ooTextFile short"', '"TextGrid"', "", f"{start!r}", f"{end!r}", "<exists>", str(len(tiers))]
    for name, entries in tiers:
        lines += ['"IntervalTier"', quoted(name), f"{start!r}", f"{end!r}", str(len(entries))]
        lines += [line for label, begin, stop in entries for line in (f"{begin!r}", f"{stop!r}", quoted(label))]
    return "\n".join(lines) + "\n"


def chronological_grid(tiers, start=0.0, end=1.0):
    lines = [
        '"Praat chronological TextGrid text file"',
        f"{start!r} {end!r}   ! Time domain.",
        f"{len(tiers)}   ! Number of tiers.",
    ]
    lines += [f'"IntervalTier" {quoted(name)} {start!r} {end!r}' for name, _ in tiers]
    entries = [(begin, number, stop, label) for number, (_, tier) in enumerate(tiers, start=1) for label, begin, stop in tier]
    for begin, number, stop, label in sorted(entries):
        lines += [f"! {tiers[number - 1][0]}:", f"{number} {begin!r} {stop!r}", quoted(label)]
    return "\n".join(lines) + "\n"


def binary_grid(tiers, start=0.0, end=1.0):
    def short(text):
        return struct.pack(">B", len(text)) + text.encode("latin-1")

    def text(value):
        if value.isascii():
            return struct.pack(">h", len(value)) + value.encode()
        return struct.pack(">hh", -1, len(value)) + value.encode("utf-16-be")

    parts = [b"ooBinaryFile", short("TextGrid"), struct.pack(">ddbi", start, end, 1, len(tiers))]
    for name, entries in tiers:
        parts += [short("IntervalTier"), text(name), struct.pack(">ddi", start, end, len(entries))]
        parts += [struct.pack(">dd", begin, stop) + text(label) for label, begin, stop in entries]
    return b"".join(parts)


def json_grid(tiers, start=0.0, end=1.0):
    named = {name: {"type": "interval", "entries": [[b, e, label] for label, b, e in entries]} for name, entries in tiers}
    return json.dumps({"start": start, "end": end, "tiers": named})


def put(path, content, encoding="utf-8"):
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path
