"""Certificates for Zenoh: an authority, a certificate for each role, a router's configuration."""
