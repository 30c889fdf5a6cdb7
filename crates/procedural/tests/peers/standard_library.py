"""MaterialX' standard library, and files beside it."""

from pathlib import Path

import MaterialX as mx


def with_library(*, path: Path | None = None) -> mx.Document:
    """A document with the standard library and, where a path is given, that file's elements."""
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    document = mx.createDocument()
    if path is not None:
        mx.readFromXmlFile(document, str(path))
    document.importLibrary(library)
    return document
