"""Bundles of networks in torch."""
