import numpy as np
import pytest
import torch
from scipy.linalg import solve_toeplitz
from scipy.signal import butter, freqz, lfilter

from facesynth.inference.errors import FacesynthError
from facesynth.speech import rasta_plp
from facesynth.speech.rasta_plp import (
    RastaPlp,
    critical_bands,
    equal_loudness,
    levinson_durbin,
    predictor_to_cepstra,
    rasta_response,
)

RATE = 16000


def speechlike(seed, seconds=1.0):
    """Noise through two moving formants, switched on and off like syllables."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=round(seconds * RATE))
    low, high = butter(2, [300, 900], "band", fs=RATE), butter(2, [1200, 2600], "band", fs=RATE)
    envelope = 0.5 + 0.5 * np.sin(2 * np.pi * 4 * np.arange(len(noise)) / RATE)
    return (0.1 * (envelope * lfilter(*low, noise) + (1 - envelope) * lfilter(*high, noise))).astype(np.float32)


def plainly(audio, rate=RATE, *, window_s=0.025, hop_s=0.010, order=8, lift=0.6):
    """RASTA-PLP again, frame by frame and band by band, with the textbook tools for each step."""
    length, hop = round(window_s * rate), round(hop_s * rate)
    fft = 2 ** int(np.ceil(np.log2(length)))
    padded = np.concatenate([np.zeros(length // 2), np.asarray(audio, float), np.zeros(length + hop)])
    window = 0.54 - 0.46 * np.cos(2 * np.pi * np.arange(length) / (length - 1))
    top = 6 * np.log(rate / 2 / 600 + np.sqrt((rate / 2 / 600) ** 2 + 1))
    count = int(np.ceil(top)) + 1
    log_energy = []
    for k in range(1 + len(audio) // hop):
        spectrum = np.fft.fft(padded[k * hop : k * hop + length] * window, fft)
        bands = np.zeros(count)
        for b in range(count):
            for i in range(fft // 2 + 1):
                f = i * rate / fft
                z = 6 * np.log(f / 600 + np.sqrt((f / 600) ** 2 + 1)) - b * top / (count - 1)
                db = 0 if abs(z) <= 0.5 else (25 * (z + 0.5) if z < 0 else -10 * (z - 0.5))
                bands[b] += 10 ** (db / 10) * (abs(spectrum[i]) ** 2 + np.sum(window**2) / 12 / 2**30)
        log_energy.append(np.log(bands))
    log_energy = np.array(log_energy)
    constant_past = np.concatenate([np.repeat(log_energy[:1], 2000, axis=0), log_energy])
    filtered = lfilter([0.2, 0.1, 0, -0.1, -0.2], [1, -(0.94 ** (hop_s / 0.01))], constant_past, axis=0)[2000:]
    features = []
    for frame in filtered:
        f2 = np.array([(600 * np.sinh(b * top / (count - 1) / 6)) ** 2 for b in range(count)])
        loud = np.exp(frame) * (f2 / (f2 + 1.6e5)) ** 2 * (f2 + 1.44e6) / (f2 + 9.61e6)
        loud = loud ** (1 / 3)
        loud[0], loud[-1] = loud[1], loud[-2]
        r = np.array([np.mean(np.concatenate([loud, loud[-2:0:-1]]) * np.cos(np.pi * m * np.arange(2 * count - 2) / (count - 1)))
                      for m in range(order + 1)])  # fmt: skip
        a = np.concatenate([[1.0], solve_toeplitz(r[:-1], -r[1:])])
        log_model = np.log(a @ r) - 2 * np.log(np.abs(np.fft.fft(a, 4096)))
        cepstrum = np.fft.ifft(log_model).real[: order + 1]
        features.append([c * (n**lift if n else 1) for n, c in enumerate(cepstrum)])
    return np.array(features)


def test_agrees_with_a_plainly_written_reference():
    audio = speechlike(0, 0.35)
    np.testing.assert_allclose(RastaPlp()(torch.from_numpy(audio)), plainly(audio), atol=2e-5)


def test_agrees_at_another_rate_window_hop_and_order():
    audio = speechlike(1, 0.3)
    features = RastaPlp(8000, window_s=0.032, hop_s=0.016, order=5)(torch.from_numpy(audio))
    np.testing.assert_allclose(features, plainly(audio, 8000, window_s=0.032, hop_s=0.016, order=5), atol=2e-5)


def test_filter_passes_syllables_and_stops_channels():
    frequencies_hz, response = freqz(rasta_response(0.94), worN=4096, fs=100)
    theory = freqz([0.2, 0.1, 0, -0.1, -0.2], [1, -0.94], worN=4096, fs=100)[1]
    np.testing.assert_allclose(response, theory, atol=1e-7)
    gain = np.abs(response)
    assert gain[0] < 1e-7
    assert 2 < frequencies_hz[gain.argmax()] < 10
    assert gain[np.searchsorted(frequencies_hz, 0.1)] < 0.4 * gain.max()


def test_a_fixed_channel_barely_moves_the_features():
    audio = speechlike(2, 3.0)
    through_channel = lfilter([1.0, -0.6], [1.0], audio).astype(np.float32)
    plp = RastaPlp()
    clean, coloured = plp(torch.from_numpy(audio)), plp(torch.from_numpy(through_channel))
    without = [
        plp.cepstra((torch.cat([*plp.band_energies(torch.from_numpy(a).double())]) * plp.loudness) ** (1 / 3))
        for a in (audio, through_channel)
    ]
    moved = (clean - coloured)[50:, 1:].square().mean() / clean[50:, 1:].var(0).mean()
    moved_without = (without[0] - without[1])[50:, 1:].square().mean() / without[0][50:, 1:].var(0).mean()
    assert moved < 0.1
    assert moved < 0.1 * moved_without


def test_a_long_sound_is_heard_some_frames_at_a_time_as_the_whole_is(monkeypatch):
    audio = torch.from_numpy(speechlike(4, 5.0))
    whole = RastaPlp()(audio)
    monkeypatch.setattr(rasta_plp, "FRAMES_TOGETHER", 64)
    torch.testing.assert_close(RastaPlp()(audio), whole, rtol=0, atol=0)


def test_loudness_of_the_recording_does_not_matter():
    audio = torch.from_numpy(speechlike(3))
    np.testing.assert_allclose(RastaPlp()(audio), RastaPlp()(audio * 0.3), atol=0.02)


def test_batches_are_the_same_as_one_by_one():
    plp = RastaPlp()
    batch = torch.stack([torch.from_numpy(speechlike(s)) for s in range(4)]).reshape(2, 2, -1)
    features = plp(batch)
    assert features.shape == (2, 2, 101, 9)
    torch.testing.assert_close(features[1, 0], plp(batch[1, 0]))


def test_frames_lie_on_a_grid_of_the_hop():
    assert RastaPlp().fps == 100
    click = torch.zeros(RATE)
    click[8000] = 0.9
    (energies,) = RastaPlp().band_energies(click.double())
    energy = energies.sum(-1)
    assert energy.argmax() == 50


def test_silence_is_finite_and_flat():
    features = RastaPlp()(torch.zeros(4000))
    assert torch.isfinite(features).all()
    assert features.std(0).max() < 0.2


def test_all_pole_model_of_a_known_resonator():
    polynomial = torch.tensor([1.0, -1.2, 0.7], dtype=torch.float64)
    power = 2.5 / torch.fft.fft(polynomial, 4096).abs() ** 2
    found, gain = levinson_durbin(torch.fft.ifft(power).real[:3])
    torch.testing.assert_close(found, polynomial)
    torch.testing.assert_close(gain, torch.tensor(2.5, dtype=torch.float64))
    torch.testing.assert_close(
        predictor_to_cepstra(found, gain), torch.fft.ifft(power.log()).real[:3] * torch.tensor([1.0, 1.0, 1.0])
    )


def test_gradients_reach_the_sound():
    audio = torch.from_numpy(speechlike(4, 0.2)).requires_grad_()
    RastaPlp()(audio).square().sum().backward()
    assert torch.isfinite(audio.grad).all()
    assert audio.grad.abs().max() > 0


def test_curves_of_hearing():
    bands = critical_bands(RATE, 512)
    assert bands.shape == (257, 21)
    assert bands.max() == 1
    loudness = equal_loudness(np.linspace(0, 19.7, 21))
    assert 12 < loudness.argmax() <= 20
    assert (np.diff(loudness[1:10]) > 0).all()


def test_impossible_orders_are_refused():
    with pytest.raises(FacesynthError, match="order"):
        RastaPlp(order=40)
