import bringing
import pytest


@pytest.fixture(scope="session")
def talker(tmp_path_factory):
    return bringing.talker(tmp_path_factory.mktemp("talker"))
