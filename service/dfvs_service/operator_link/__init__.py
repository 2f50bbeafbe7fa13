"""Operator link process: state and answers out, commands in."""
