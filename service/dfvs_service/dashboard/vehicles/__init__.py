"""Vehicles as the dashboard sees them: samples, models, rates and clocks."""
