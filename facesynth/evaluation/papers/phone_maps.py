"""Maps of a phone's frames: Deng 2008, figures 5 to 9, and Deng 2006, figures 5.22 to 5.26."""

from scipy.sparse.csgraph import shortest_path

from facesynth.evaluation.figures import as_uri, new_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.methods.capabilities import Browsing
from facesynth.motion.maps.isomap import NEIGHBOURS, evenly, neighbour_graph, residual_variance
from facesynth.motion.maps.phone_map import Kind, PhoneMap, emotion_colours

MOST_FRAMES = 1200
"""Of which the ways along the cloud are found."""
SIZE = (320, 320)
BRIGHTNESS = {"rho": 0.25, "sigma": 0.006}
"""Of a node's frame: fainter and smaller than on a screen, as all are shown at once."""
KINDS: tuple[Kind, ...] = ("pca", "isomap")
TITLES = ("principal components", "Isomap", "Isomap: a node, and nodes halfway", "Isomap: the same neighbours")


def maps(model: Browsing, material: Material, where: str) -> list[Finding]:
    """The phone with the most nodes on both kinds of map."""
    phone = _fullest(model)
    plane, curved = (model.phone_map(phone, kind) for kind in KINDS)
    what = f"residual variance of {phone} ({len(plane.cluster.names)} nodes): principal components, Isomap"
    ours = values(_residuals(plane, curved), "{:.2f}")
    return [Finding(where, what, "pictures", ours, False, material.unlike, figure=_picture(plane, curved))]


def _fullest(model: Browsing) -> str:
    """The phone, not the silence, with the most nodes."""
    counts = {phone: len(model.phone_map(phone, "pca").cluster.names) for phone in model.mapped_phones() if phone != SILENCE}
    if not counts:
        raise FacesynthError("the recordings say no phone of which there could be a map")
    return max(counts, key=lambda phone: counts[phone])


# 1 - R² between distances along the cloud, which are found step by step between neighbours, and those in the plane.
def _residuals(*maps: PhoneMap) -> list[float]:
    frames = maps[0].cluster.frames
    some = evenly(len(frames), MOST_FRAMES)
    ways = shortest_path(neighbour_graph(frames[some], min(NEIGHBOURS, len(some) - 1)), directed=False)
    return [residual_variance(ways, one.plane.points[some]) for one in maps]


def _picture(plane: PhoneMap, curved: PhoneMap) -> str:
    """Both maps in the colours of the emotions; on the second the longest node with where all are halfway, and its context."""
    cluster = curved.cluster
    name = cluster.names[int(cluster.lengths.argmax())]
    alike = curved.context_correct(*cluster.contexts[cluster.place(name)])
    figure, axes = new_figure(11, 3.4, 1, 4)
    shown = ((plane, None), (curved, None), (curved, None), (curved, alike))
    for axis, title, (one, nodes) in zip(axes[0], TITLES, shown, strict=True):
        axis.imshow(one.picture(SIZE, nodes, **BRIGHTNESS), extent=one.plane.extent(SIZE))
        axis.set(xticks=[], yticks=[])
        axis.set_title(title, fontsize=8)
    limits = axes[0, 2].axis()
    axes[0, 2].plot(*curved.time_correct(0.5).T, ".", color="white", markersize=2)
    axes[0, 2].plot(*curved.curve(name).T, color="yellow", linewidth=1)
    axes[0, 2].axis(limits)
    for emotion, colour in emotion_colours(sorted(set(cluster.emotions))).items():
        axes[0, 0].plot([], [], "s", color=colour, label=emotion)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=4, loc="outside lower center")
    return as_uri(figure, "png")
