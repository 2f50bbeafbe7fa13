import pytest

from dfvs_service.dashboard.tokens import Role, Tokens

VIEWER, OPERATOR = b"v" * 32, b"o" * 32


@pytest.mark.parametrize(
    ("tokens", "token", "role"),
    [
        (Tokens(is_open=True), "", Role.VIEWER),
        (Tokens(is_open=True), "anything", Role.NOBODY),
        (Tokens(), "", Role.NOBODY),
        (Tokens(None, OPERATOR, is_open=True), "", Role.VIEWER),
        (Tokens(None, OPERATOR, is_open=True), OPERATOR.decode(), Role.OPERATOR),
        (Tokens(None, OPERATOR), "", Role.NOBODY),
        (Tokens(VIEWER, OPERATOR), VIEWER.decode(), Role.VIEWER),
        (Tokens(VIEWER, OPERATOR), OPERATOR.decode(), Role.OPERATOR),
        (Tokens(VIEWER, OPERATOR), "v" * 31, Role.NOBODY),
        (Tokens(VIEWER, OPERATOR), "v" * 33, Role.NOBODY),
        (Tokens(VIEWER), "\ud800", Role.NOBODY),
        (Tokens(None, b""), "x", Role.NOBODY),
    ],
)
def test_a_token_gives_its_role_and_nothing_else_does(tokens, token, role):
    assert tokens.role_of(token) is role
