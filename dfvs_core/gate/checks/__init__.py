"""Checks before and during a flight: preflight, initial response, perception's reports."""
