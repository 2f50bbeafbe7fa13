import pytest

from dfvs_core.gate.config import MS, GateConfig, S
from dfvs_core.gate.events import Attitude, Heartbeat, LocalPosition, VehicleMode
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.vehicle import VehicleMonitor
from dfvs_core.messages.link import from_gate, to_datagram
from dfvs_core.perception.vehicle_history import VehicleHistory
from dfvs_service.gate.status import gate_status, vehicle_state


def status(machine, now_ns):
    return gate_status(machine, now_ns, challenge="", command=("", 0), warnings=())


def test_a_status_tells_since_when_the_state_is():
    machine = GateMachine(GateConfig(), 5 * S)
    assert status(machine, 7 * S).since_ns == 5 * S
    machine.step(8 * S, [Heartbeat(8 * S, VehicleMode.HOLD, armed=True)])
    machine.step(8 * S + 20)
    assert status(machine, 9 * S).state == "PREFLIGHT"
    assert status(machine, 9 * S).since_ns == pytest.approx(8 * S, abs=20)


@pytest.mark.parametrize("sign", ["w", "録", "\U0001f681", '"', "\0"])
def test_long_texts_in_any_script_fit_one_datagram(sign):
    machine = GateMachine(GateConfig(), 5 * S)
    machine.reason = 1000 * sign
    told = gate_status(
        machine, 7 * S, challenge="c" * 32, command=(200 * sign, 1), warnings=(1000 * sign,) * 9
    )
    assert from_gate(to_datagram(told)) == told
    for text in (told.cause, *told.warnings):
        assert len(text) >= 25
        assert set(text) == {sign}


@pytest.mark.parametrize("missing_ms", [200, 350, 450])
def test_no_way_is_lost_while_the_position_alone_is_missing_for_as_long_as_the_link_check_allows(
    missing_ms,
):
    vehicle, history = VehicleMonitor(), VehicleHistory()
    for t_ms in range(0, 4000, 20):
        vehicle.update(Attitude(t_ms * MS, 0.0, 0.0, 0.0))
        if not 2000 <= t_ms < 2000 + missing_ms:
            vehicle.update(LocalPosition(t_ms * MS, (1e-3 * t_ms, 0.0, 0.0), (1.0, 0.0, 0.0)))
        history.add(vehicle_state(vehicle))
    assert history.at(3900 * MS).displacement_m[0] == pytest.approx(3.9)
