"""Operator commands: admission, signature and command authority."""
