"""The exception of the library."""

from palpate._enums import ErrorCode


class Error(Exception):
    """An invalid call. The call leaves the object unchanged.

    code      an ErrorCode; Docs/Errors.md has cause and remedy of each
    geometry  id of the geometry at fault, or None
    element   index of the vertex or element at fault, or None; the message says which it is
    """

    code: ErrorCode
    geometry: int | None
    element: int | None

    def __init__(
        self,
        message: str,
        code: ErrorCode,
        geometry: int | None = None,
        element: int | None = None,
    ) -> None:
        super().__init__(message)
        self.code = ErrorCode(code)
        self.geometry = geometry
        self.element = element

    def __reduce__(self) -> tuple[type["Error"], tuple[str, ErrorCode, int | None, int | None]]:
        return type(self), (str(self), self.code, self.geometry, self.element)


class BadInput(Exception):
    """Input that cannot be checked. The message names file, frame, body and element."""
