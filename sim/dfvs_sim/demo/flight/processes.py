"""Processes of one demo flight and the words that start them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dfvs_common.child import Child
from dfvs_sim.demo.flight.camera_link import CameraLink
from dfvs_sim.demo.flight.ports import LOOPBACK, FlightPorts
from dfvs_sim.demo.image_size import service_threads
from dfvs_sim.demo.options import FIRST_SYSTEM_ID, FlightOptions


@dataclass(frozen=True, slots=True)
class FlightProcesses:
    """Makes the processes of a flight; none is started before its context is entered."""

    options: FlightOptions
    ports: FlightPorts
    camera: CameraLink
    """How frames travel to the service."""
    folder: Path
    """Takes logs and records."""
    seed: int
    """Of the simulated vehicle's noise."""

    @property
    def vehicle_record(self) -> Path | None:
        """The simulated vehicle's own record; None beside another autopilot."""
        return self.folder / "vehicle.jsonl" if self.options.is_simulated else None

    def vehicle(self) -> Child:
        """Simulated vehicle."""
        system_id = self.options.system_id or FIRST_SYSTEM_ID
        words = [
            *("dfvs_sim.cli", "vehicle", "--seed", str(self.seed), "--system-id", str(system_id)),
            *self.options.conditions.words,
            *("--companion-port", str(self.ports.companion), "--companion-local-port", "0"),
            *("--gcs-port", str(self.ports.ground), "--gcs-local-port", "0"),
            *("--record", str(self.vehicle_record)),
        ]
        return Child("vehicle", words, self.folder / "vehicle.log")

    def service(self, goals: Sequence[Path], system_id: int | None) -> Child:
        """``dfvs-service`` with the images of its goals; no id leaves it to its settings."""
        mavlink = self.options.autopilot or f"udpin://{LOOPBACK}:{self.ports.companion}"
        named = () if system_id is None else ("--set", f"vehicle.system_id={system_id}")
        words = [
            *("dfvs_service.cli", "--goal", *map(str, goals)),
            *("--vehicle", self.options.vehicle, "--mavlink", mavlink),
            *named,
            *("--set", f'zenoh.listen=["{self.ports.zenoh_endpoint}"]'),
            *("--set", f"flow.threads={service_threads()}"),
            *self.camera.service_words,
            *self.options.service,
        ]
        return Child("service", words, self.folder / "service.log")

    def dashboard(self) -> Child:
        """Page that shows the flight."""
        words = ["dfvs_service.dashboard.cli", "--port", str(self.ports.dashboard)]
        words += ["--connect", self.ports.zenoh_endpoint]
        return Child("dashboard", words, self.folder / "dashboard.log")
