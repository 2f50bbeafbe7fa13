"""The dashboard: one page in a browser, fed by the telemetry of one or several vehicles.

It subscribes like anybody else and owns nothing of the flight; an operator's commands go the way of
every signed command.
"""
