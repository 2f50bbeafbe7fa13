"""Frame records that cannot be read, as of a service of another version, over real Zenoh."""

from loopback import listening_peer
from waiting import until

from dfvs_core.messages.topics import Topics
from dfvs_service.record.follow import RecordListener

TOPICS = Topics("swift")


def test_records_that_cannot_be_read_are_counted_and_told_of_once(capsys):
    with listening_peer() as (session, _):
        listener = RecordListener(session, TOPICS)

        def are_dropped():
            assert listener.receive(0.0) == []
            return listener.dropped == 3

        for _ in range(3):
            session.put(TOPICS.telemetry("turn"), b"{}")
        assert until(are_dropped, 10.0)
        listener.close()
    assert capsys.readouterr().err.count("is the service of another version?") == 1
