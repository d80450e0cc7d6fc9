"""Text in UTF-16, as some Windows programs write it."""

import codecs

# Bytes at the beginning of a file by which its encoding is recognised.
HEAD = 64


def as_utf8(data: bytes) -> bytes:
    """Text in UTF-16 as UTF-8; anything else as it is.

    Recognised by a byte order mark, or by every other byte being zero, as in UTF-16 of ASCII characters.
    """
    marked = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}.get(data[:2])
    text = data[2:] if marked else data
    # After a mark the first character decides, since binary data may begin with any bytes.
    even, odd = text[: 2 if marked else HEAD : 2], text[1 : 2 if marked else HEAD : 2]
    if even and all(even) and not any(odd):
        encoding = "utf-16-le"
    elif odd and all(odd) and not any(even):
        encoding = "utf-16-be"
    else:
        return data
    if len(text) % 2 or (marked and marked != encoding):
        return data
    return text.decode(encoding, "replace").encode()
