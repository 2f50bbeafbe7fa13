"""The vehicle's motion: what each mode demands, from take-off to landing."""
