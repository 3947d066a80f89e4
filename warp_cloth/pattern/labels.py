"""What the texts of a drawn piece state: its name, its size, and how often it is cut."""

from __future__ import annotations

import re

from warp_cloth.pattern.dxf_drawn import Drawn
from warp_cloth.pattern.kinds import named

# Keys of texts, in the languages of programs
NAME_KEYS = (
    *("piecename", "partname", "piece", "part", "name", "patternname", "teilename", "teilbezeichnung", "bezeichnung"),
    *("nompiece", "nomdelapiece", "nom", "nombrepieza", "nombredelapieza", "nombre", "pieza", "nomepezzo", "nome"),
    *("nomedapeca", "peca", "naam", "onderdeel", "nazwa", "element", "parca", "parcaadi", "деталь", "наименование"),
    *("パーツ名", "部位", "裁片", "裁片名称", "样片名称", "패턴명"),
)
SIZE_KEYS = (
    *("size", "sizename", "groesse", "grosse", "konfektionsgrosse", "taille", "talla", "taglia", "tamanho", "maat"),
    *("rozmiar", "beden", "storlek", "storrelse", "velikost", "размер", "サイズ", "尺码", "尺寸", "号型", "사이즈"),
)
COUNT_KEYS = (
    *("quantity", "qty", "pieces", "cut", "cutquantity"),
    *("anzahl", "stuckzahl", "quantite", "cantidad", "quantita", "quantidade", "aantal", "ilosc", "sztuk", "adet"),
    *("antal", "pocet", "количество", "колво", "枚数", "数量", "裁片数", "수량"),
)
NOTE_KEYS = ("annotation", "annotations", "remark", "description")
PAIR = r"\bpairs?\b|\bpaare?\b|\bpaires?\b|\bpar(es)?\b|\bpai[ao]\b|[对对双雙]"
PLEATED = (
    r"\bpleat|\bfalte|kellerfalte|\bpliss|(?<!\ble )(?<!\bau )(?<!\bsur )\bplis? |\bplisad|\btabla\b|\bpieghe?\b|褶"
    r"|プリーツ|주름"
)
ON_FOLD = (
    r"\bon (the )?fold|\b(au|sur)( le| la)? pli|\bpliure|\b(im )?bruch\b|\bi\. ?br\b|\b(im )?stoffbruch"
    r"|\bdoblez|\bpiega\b|\b(na|pela) dobra|dobra do tecido"
    r"|stofvouw|\b(aan|op|tegen) (de )?vouw"
    r"|\bkatta\b|\bkat(a|tan)? (yerinde|izi)|zgi[eę]ci|złożeni|přehyb|\bmot vikning"
    r"|\btygvikning|\bmot brett|\bmod fold|\btaite|сгиб|згин|对折|對折|わ裁|골선"
)
TO_CUT = "cut|zuschneiden|schneiden|couper|cortar|tagliare|knippen|wytnij|вырезать|klipp"
TIMES = "(?:mal|fois|veces|vezes|volte|times|keer)"
# How often to cut, in words of labels ("Cut 2", "2x", "SHELL*1"), and of left and right ("L*1-R*1")
CUT_TIMES = (
    rf"\b(?:{TO_CUT})\s*:?\s*(\d{{1,2}})\b(?:\s*(?:x|{TIMES})\b)?",
    r"(?<![\w.,])(\d{1,2})\s*[x×](?!\s*[a-z]?\d)",
    r"(?:\w|^)\s*[*×]\s*(\d{1,2})\b",
    r"(?<=\w )[x×](\d{1,2})$",
    rf"(?<!\w)(\d{{1,2}})\s*(?:{TIMES}\b|adet\b|szt\b|sztuk)",
    r"(?<!\w)(\d{1,2})\s*(?:дет\b|детал|шт\b|枚|片)",
)
MEASURED = r"\s*(?:[.,/]\d|[\"'″′%]|[cm]m\b|in(?:ch(?:es)?)?\b)"  # what follows a number that is no count
# "Cut 1+1 shell", "cut 1,1": not "cut 2, 1 cm seam allowance", nor "cut 4, 2 pairs"
AND_MIRRORED = (
    rf"\b(?:{TO_CUT})\s*:?\s*(\d{{1,2}})"
    rf"(?:\+(?=\d+\b(?!{MEASURED}))|\s*[,+]\s*(?=\d+\b(?!{MEASURED}|\s*\w)))(\d{{1,2}})\b"
)
LEFT_RIGHT = r"\bl\w{0,4}\s*[*×x=:]?\s*(\d{1,2})\b.{0,4}\br\w{0,5}\s*[*×x=:]?\s*(\d{1,2})\b"
# A block's name with a number to cut and its place in the file, as some programs name blocks ("BACK YOKEX1-35")
COUNTED_BLOCK = re.compile(r"^(.*\S)\s?X(\d{1,2})-(\d{1,4})$")
NO_NAME = re.compile(r"^[\W\d]*$")
NUMBERED = re.compile(r"^\D{0,8}\d+$")  # a block's name as programs make it: "B3", "PART_12"
MOST_WORDS = 4  # of a label that is a name, and no remark
NO_LETTER = re.compile(r"^[\W_]*$")  # of a block's name: letters that were lost


def name_of(drawn: Drawn) -> str:
    """The name of a piece: as stated, or its block's, or of its label what says what it is."""
    stated = plain_text(drawn.said(*NAME_KEYS))
    if stated:
        return stated
    counted = COUNTED_BLOCK.match(drawn.block)
    block = plain_text(drawn.block if counted is None else counted[1])
    block = "" if NO_LETTER.match(block) else block
    if NUMBERED.match(block) and (re.match(r"^\D\d", block) or not named(block).kind):  # a label says more
        label = _label(drawn.remarks)
        if named(label).kind and len(label.split()) <= MOST_WORDS:
            return label
    return block or _label(drawn.remarks) or "piece"


def _label(remarks: list[str]) -> str:
    """The line of a label that names a piece, else its first one that is a word and no number to cut.

    A line that says how often to cut, too, ("FRONT - cut 1x on fold") counts after those that do not.
    """
    lines = [line for line in map(plain_text, remarks) if not NO_NAME.match(line)]
    words = [line for line in lines if _count(line.lower()) is None and not re.search(ON_FOLD, line.lower())]
    telling = [line for line in words if named(line).kind]
    counted = [_without_count(line) for line in lines if line not in words]
    telling += [line for line in counted if named(line).kind not in ("", "none")]
    # one line is all there is: the name and a count of one cloth
    if not telling and not words and len(lines) == 1 and len(re.findall(r"\d+", lines[0])) == 1:
        return "" if counted[0] == lines[0] else counted[0]
    return next(iter(telling or words), "")


def _without_count(line: str) -> str:
    """A line of a label without how often to cut and without the fold; itself where nothing else is in it."""
    rest = line
    for pattern in (*CUT_TIMES, ON_FOLD, rf"\b({TO_CUT})\b"):
        rest = re.sub(pattern, " ", rest, flags=re.IGNORECASE)
    return re.sub(r"\s+", " ", rest).strip(" -:;,.()/") or line


def size_of(drawn: Drawn) -> str:
    return plain_text(drawn.said(*SIZE_KEYS))


def plain_text(text: str) -> str:
    """One line of printable characters."""
    return re.sub(r"\s+", " ", "".join(c if c.isprintable() else " " for c in text)).strip()[:100]


def copies_of(drawn: Drawn, texts: dict[str, str]) -> tuple[int, int] | None:
    """How many are cut as drawn, and mirrored: "2" means a pair, "1,1" says so; None: not stated.

    Args:
        drawn: the piece.
        texts: what it states, and what other sizes of it state.
    """
    text = next((texts[key] for key in COUNT_KEYS if texts.get(key)), "")
    numbers = [min(int(each), 99) for each in re.findall(r"\d{1,4}", text)[:2]]
    if re.search(PAIR, text.lower()):
        count = max(numbers[:1] or [1])
        return count, count
    if any(numbers):
        return (numbers[0], numbers[1]) if len(numbers) == 2 else _pair(numbers[0])
    counted = COUNTED_BLOCK.match(drawn.block)
    if counted is not None and int(counted[2]):
        return _pair(int(counted[2]))
    for note in (*(texts.get(key, "") for key in NOTE_KEYS), *drawn.remarks):
        found = _count(note.lower())
        if found is not None:
            return found
    return None


def _pair(count: int) -> tuple[int, int]:
    return (count + 1) // 2, count // 2


def _count(text: str) -> tuple[int, int] | None:
    sides = re.search(LEFT_RIGHT, text) or re.search(AND_MIRRORED, text)
    if sides is not None and int(sides[1]) + int(sides[2]) > 0:
        return int(sides[1]), int(sides[2])
    found = next((match for words in CUT_TIMES if (match := re.search(words, text))), None)
    if found is None or not int(found[1]):
        return None
    count = int(found[1])
    return (count, count) if re.search(PAIR, text) else _pair(count)
