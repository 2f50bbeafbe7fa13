"""Pairs of views with exact flow: to measure correspondences by, and to train networks on."""
