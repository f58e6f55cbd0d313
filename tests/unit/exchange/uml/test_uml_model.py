"""Models of UML with MARTE and S3D: six hand-made files, examples there and back, and hostile files."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from lxml import etree

from rigs.watch_model import write_watch_model
from volery.base.errors import ModelError, UsageError
from volery.cli.commands.first_steps import example
from volery.exchange.convert import export_model, import_model, read_uml
from volery.exchange.uml.uml_model import export_uml, import_uml
from volery.exchange.uml.xmi import xmi_id
from volery.exchange.xml_text import MOST_BYTES
from volery.model.assembly import read_tree
from volery.model.document import schema
from volery.model.text import parse
from volery.model.writing import model_text
from volery.run.assembly.model_checks import vocabulary

MODELS = Path(__file__).parent / "models"
FILES = sorted(path.stem for path in MODELS.glob("*.uml"))
KINDS = {"A72": "rpi4-cortex-a72", "Cortex-A72": "rpi4-cortex-a72"}
CATALOGUE = ("rpi4-cortex-a72", "intel-i5-3470")


def read(name, data=None):
    data = (MODELS / f"{name}.uml").read_bytes() if data is None else data
    return import_uml(data, f"{name}.uml", catalogue=CATALOGUE, processors=KINDS)


def said(imported):
    return [str(note) for note in imported.notes]


def test_there_are_six_files():
    assert FILES == ["all_views", "conflicts", "empty_tags", "minimal", "older_namespaces", "other_writer"]


# -- what is understood


def test_every_element_of_the_minimal_file_is_understood():
    imported = read("minimal")
    assert imported.tree["components"]["Detector"] == {
        "language": "c++",
        "path": "src/detector",
        "provides": {"img": "ImageIn"},
        "queues": {"img": {"size": 4}},
        "active": {"period": "200 ms", "deadline": "200 ms"},
        "activation": {"time": "8 ms", "best": "1 ms", "worst": "15 ms"},
    }
    assert imported.tree["application"] == {"det": {"is": "Detector"}}
    assert imported.tree["memory_spaces"] == {"vision": None}
    assert imported.tree["allocations"] == {"default": {"det": "vision"}}
    processors = imported.tree["platform"]["processors"]
    assert processors == {"A72": {"is": "rpi4-cortex-a72", "frequency": "1.5 GHz", "cores": 4}}
    understood = {xmi_id(each) for each in imported.keys.values()} | {"m", "app"}
    applied = {xmi_id(each) for each in imported.file.bases}
    every = {xmi_id(each) for each in imported.file.root.iter() if xmi_id(each)}
    assert every == understood | applied
    assert len(said(imported)) == 1
    assert "no processor is known that its times were taken at" in said(imported)[0]


def test_older_namespaces_say_the_same():
    assert read("older_namespaces").tree == read("minimal").tree


def test_all_views_are_read():
    tree = read("all_views").tree
    assert tree["interfaces"] == {"Grab": {"grab": {"args": {"count": "int"}, "returns": "Image[]"}}}
    assert tree["types"] == {"Image": {"fields": {"width": "int"}}, "Mode": {"values": ["day", "night"]}}
    camera, detector = tree["components"]["SysCamera"], tree["components"]["SysDetector"]
    assert (camera["language"], camera["path"]) == ("c++", "src/camera.cpp")
    assert camera["files"] == {"python": "model/camera.py"}
    assert camera["queues"] == {
        "pictures": {"size": 2, "retries": 1, "full": "remove-first", "timeout": "50 ms"}
    }
    assert camera["operations"] == {"grab": {"time": "3 ms", "best": "1 ms"}}
    assert detector["active"] == {"period": "100 ms", "deadline": "80 ms", "jitter": "2 ms", "priority": 7}
    assert detector["activation"] == {"time": "12 ms", "provenance": "measured", "energy": "30 mJ"}
    assert detector["at"] == {"processor": "rpi4-cortex-a72", "frequency": "1.5 GHz"}
    assert tree["application"]["detector"] == {"is": "SysDetector", "eyes": "front_camera.pictures"}
    platform = tree["platform"]
    assert platform["operating_systems"] == {
        "linux": {"type": "Linux", "ipc": "sharedMemory", "drivers": ["v4l2"]}
    }
    assert platform["processors"]["cpu0"]["caches"]["l2"]["size"] == "1024 kB"
    assert platform["networks"] == {"bus": {"between": ["cpu0", "cpu1"], "bandwidth": "100 Mbit/s"}}
    assert platform["devices"] == {"lens": {"kind": "sensor"}}
    assert tree["allocations"]["Architecture"] == {
        "front_camera": "vision_exe",
        "detector": "vision_exe",
        "vision_exe": "linux",
        "linux": "cpu0",
    }
    assert tree["environment"]["components"] == {"scene": {"is": "Scene"}}
    head = "platform.processors."
    assert tree["design_parameters"] == {
        "clock": {"paths": f"{head}cpu0.frequency", "values": ["600 MHz", "900 MHz", "1200 MHz", "1500 MHz"]},
        "both": {"paths": [f"{head}cpu0.frequency", f"{head}cpu1.frequency"], "values": ["1 GHz", "1.5 GHz"]},
    }


def test_empty_tags_and_expressions_are_noted_not_fatal():
    imported = read("empty_tags")
    assert imported.tree["components"]["Unit"]["activation"] == {"time": "5 ms", "provenance": "estimated"}
    notes = "\n".join(said(imported))
    for piece in (
        "a port without an interface",
        "'other' for full queues",
        "no execution time can be read from '(expr=$x,",
        "'2nd unit' is no name in a model; it is '_2nd_unit' there",
        "it refers to 'gone', which does not exist",
        "it refers to 'nowhere', which does not exist",
        "a stereotype of a profile that is not read",
        "`import --processor board=NAME`",
    ):
        assert piece in notes, piece
    assert all(re.match(r"empty_tags\.uml:\d+: .*\([a-z]+\d*\): ", line) for line in said(imported))


def test_the_form_of_other_writers_is_read():
    tree = read("other_writer").tree
    assert tree["application"] == {"one": {"is": "A", "mouth": "two.ear"}, "two": {"is": "B"}}
    assert tree["allocations"] == {"default": {"one": "cpu", "two": "cpu"}}
    assert tree["requirements"] == {"quiet": {"observe": "one.failures", "max": 0}}


def test_conflicts_are_noted_with_their_place():
    notes = "\n".join(said(read("conflicts")))
    for piece in (
        "user.use is connected twice",
        "user is allocated to cpu already",
        "an interface that inherits from itself",
        "no component can be in 'ada'",
        "something else is 'server_1', too",
        "'App' is no place in a model",
    ):
        assert piece in notes, piece


# -- there and back


@pytest.mark.parametrize("name", FILES)
def test_an_export_into_the_file_changes_nothing_that_it_does_not_know(name):
    imported = read(name)
    before = {xmi_id(each): dict(each.attrib) for each in imported.file.root.iter() if xmi_id(each)}
    text, notes = export_uml(imported.tree, name, base=imported)
    again = read(name, text.encode())
    assert again.tree == imported.tree
    assert notes == ()
    after = {xmi_id(each): dict(each.attrib) for each in again.file.root.iter() if xmi_id(each)}
    kept = {
        key: value for key, value in before.items() if key not in {xmi_id(e) for e in imported.keys.values()}
    }
    changed = [key for key, value in kept.items() if after.get(key, {}).items() < value.items()]
    assert changed == []
    assert before.keys() <= after.keys()


def test_a_removed_instance_takes_its_element_and_its_links_away():
    imported = read("all_views")
    del imported.tree["application"]["detector"]
    del imported.tree["allocations"]["Architecture"]["detector"]
    text, _ = export_uml(imported.tree, "all_views", base=imported)
    assert "i_det" not in re.findall(r'xmi:id="(\w+)"', text)
    assert "con" not in re.findall(r'xmi:id="(\w+)"', text)
    assert read("all_views", text.encode()).tree["application"] == {"front_camera": {"is": "SysCamera"}}


@pytest.mark.parametrize("name", ["starter", "cpp", "delivery"])
def test_a_model_of_volery_is_the_same_after_uml(name):
    tree = read_tree(example(name) / "model.yaml").plain()
    text, notes = export_uml(tree, "m.uml")
    assert notes == ()
    imported = read("m", text.encode())
    assert said(imported) == []
    assert imported.tree == tree
    assert parse(model_text(imported.tree), "m").plain() == tree
    again, _ = export_uml(imported.tree, "m.uml", base=imported)
    assert read("m", again.encode()).tree == tree


def test_a_model_with_every_section_is_the_same_after_uml(tmp_path):
    tree = read_tree(write_watch_model(tmp_path / "watch")).plain()
    text, notes = export_uml(tree, "m.uml")
    assert notes == ()
    imported = read("m", text.encode())
    assert said(imported) == []
    assert imported.tree == tree


EVERY_KEY = """
volery: 1
name: every-key
interfaces: {Talk: {say: {args: {words: string}, returns: int}}}
components:
  Packaged:
    language: rclpy
    package: talker
    executable: talk
    main: start
    arguments: [--verbose, "a:=b"]
    on_failure: {action: restart, max: 3, delay: 2 s}
    requires: {other: Talk}
  Written:
    language: c++
    path: src/written
    class: Writer
    build: {flags: [-O2], libraries: [z]}
    files: {python: written.py}
    provides: {voice: Talk}
    parameters: {loud: true}
    active: {period: 100 ms, deadline: 80 ms, priority: 7, start: 1 s, jitter: 2 ms}
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    operations:
      say:
        time: 2 ms
        at: {processor: rpi4-cortex-a72, frequency: 1.5 GHz}
        energy: 3 mJ
        provenance: measured
        best: 1 ms
        worst: 4 ms
        uncertainty: 5 %
    activation: {time: 1 ms}
    queues: {voice: {size: 2, full: remove-first, timeout: 50 ms, retries: 1}}
    calls: {activation: {publish: 2}}
    assume: {period: 20 ms, pause: 5 ms, beside: {time: 2 ms, best: 1 ms}, waits: 3 ms}
    publishes: {words: {type: std_msgs/String, on: activation, count: 2, size: 40 B}}
    subscribes: {orders: {type: std_msgs/String}}
    memory: 20 MB
application:
  talker:
    is: Packaged
    other: written.voice
    parameters: {loud: false}
    active: true
    arguments: [--quiet]
    namespace: /one
    node_name: other_name
    per: drone_1
    remap: {words: /words}
  written: {is: Written}
memory_spaces: {space: {memory: 100 MB, description: shared}}
"""


def test_every_key_of_components_and_instances_is_the_same_after_uml():
    tree = parse(EVERY_KEY, "every.yaml").plain()
    known = schema()["$defs"]
    components, instances = tree["components"].values(), tree["application"].values()
    written = tree["components"]["Written"]
    stated = {
        "Component": {key for one in components for key in one},
        "OnFailure": set(tree["components"]["Packaged"]["on_failure"]),
        "Activity": set(written["active"]),
        "StatedFigure": set(written["operations"]["say"]),
        "QueueSpec": set(written["queues"]["voice"]),
        "Assumptions": set(written["assume"]),
        "PublishedTopic": set(written["publishes"]["words"]),
        "CompilerOptions": set(written["build"]),
        "Instance": {key for one in instances for key in one} - {"other"},
        "MemorySpace": set(tree["memory_spaces"]["space"]),
    }
    assert stated == {name: set(known[name]["properties"]) for name in stated}
    text, notes = export_uml(tree, "m.uml")
    assert notes == ()
    imported = read("m", text.encode())
    assert said(imported) == []
    assert imported.tree == tree


def test_ids_depend_on_the_model_alone():
    tree = read_tree(example("delivery") / "model.yaml").plain()
    one, two = export_uml(tree, "a.uml")[0], export_uml(tree, "b.uml")[0]
    assert one == two
    ids = re.findall(r'xmi:id="([^"]+)"', one)
    assert len(ids) == len(set(ids))


def test_a_pass_through_another_writer_changes_nothing():
    tree = read_tree(example("delivery") / "model.yaml").plain()
    text, _ = export_uml(tree, "m.uml")
    other = ElementTree.tostring(ElementTree.fromstring(text), encoding="utf-16")
    assert read("m", other).tree == tree
    canonical = etree.tostring(etree.fromstring(text.encode()), method="c14n")
    assert read("m", canonical).tree == tree


def test_only_tags_of_the_profiles_are_written():
    """An attribute that a stereotype does not have makes EMF refuse the file."""
    tags = {
        "ClientServerQueuePort": "kind provInterface reqInterface queueSize fullPoolPolicy retry timeout",
        "HwProcessor": "frequency nbCores caches",
        "RtUnit": "main",
        "RtSpecification": "relDl occKind priority",
        "ResourceUsage": "execTime energy",
        "HwMedia": "bandWidth blockT",
        "NfpConstraint": "kind",
        "OS": "type interProcessCommunication",
        "MemoryPartition": "memorySizeFootprint",
        "FlowPort": "direction",
        "HwCache": "level type memorySize",
        "DseProcessorParameter": "name parameter unit items",
    }
    tree = read("all_views").tree
    text, _ = export_uml(tree, "m.uml")
    for element in read("m", text.encode()).file.bases:
        name = etree.QName(element).localname
        stated = {key for key in element.attrib if not key.startswith(("base_", "{"))}
        stated |= {etree.QName(each).localname for each in element}
        assert stated <= set(tags.get(name, "").split()), name


def test_paths_are_rewritten_for_the_folder_of_each_file():
    tree = {"volery": 1, "name": "m", "components": {"A": {"language": "python", "path": "code/a.py"}}}
    text, _ = export_uml(tree, "m.uml", lambda path: f"../model/{path}")
    assert "$path=../model/code/a.py;" in text
    back = import_uml(text.encode(), "m.uml", lambda path: path.removeprefix("../model/"))
    assert back.tree["components"]["A"]["path"] == "code/a.py"


# -- hostile and wrong files

BOMB = """<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;">]><x>&c;</x>"""
OUTSIDE = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY p SYSTEM "file:///etc/passwd">]><x>&p;</x>'
EMPTY = """<xmi:XMI xmlns:xmi="http://www.omg.org/spec/XMI/20131001" xmlns:uml="http://www.eclipse.org/uml2/5.0.0/UML">
<uml:Model xmi:id="m" name="x"/></xmi:XMI>"""


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (BOMB.encode(), "a document type or an entity is declared"),
        (BOMB.replace('"1.0"', '"1.0" encoding="utf-16"').encode("utf-16"), "a document type is declared"),
        (OUTSIDE.encode(), "a document type or an entity is declared"),
        (b"not XML", "this is not XML"),
        (b"", "this is not XML"),
        (b"<a><b></a>", "m.uml:1: this is not XML"),
        (b"<a>" * 100_000, "this is not XML"),
        (b"<a/>", "there is no uml:Model in it; its root is 'a'"),
        (
            b'<di:SashWindowsMngr xmlns:di="http://www.eclipse.org/papyrus/0.7.0/sashdi"/>',
            "this is a .di file",
        ),
        (EMPTY.encode(), "nothing in it is a component. Its stereotypes: none."),
        (b" " * (MOST_BYTES + 1), "at most 32 MiB are read"),
    ],
)
def test_what_is_no_model_is_refused_with_the_reason(data, expected):
    with pytest.raises(ModelError, match=re.escape(expected)):
        read("m", data)


def test_a_damaged_annotation_is_noted():
    tree = read_tree(example("delivery") / "model.yaml").plain()
    text, _ = export_uml(tree, "m.uml")
    spoilt = re.sub(r'key="wind" value="[^"]*"', 'key="wind" value="{speed: ["', text)
    assert spoilt != text
    assert any("its annotation is damaged" in line for line in said(read("m", spoilt.encode())))


# -- plain UML, analysis models, several files

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<xmi:XMI xmi:version="2.1" xmlns:xmi="http://schema.omg.org/spec/XMI/2.1" xmlns:uml="http://schema.omg.org/spec/UML/2.2"
 xmlns:GQAM="http://www.eclipse.org/papyrus/GQAM/1" xmlns:PAM="http://www.eclipse.org/papyrus/PAM/1">
<uml:Model xmi:id="m" name="plant">"""
PLAIN = """
<packagedElement xmi:type="uml:Interface" xmi:id="i" name="Scan">
 <ownedOperation xmi:id="o" name="look"/>
</packagedElement>
<packagedElement xmi:type="uml:Component" xmi:id="c1" name="Lens">
 <ownedAttribute xmi:type="uml:Port" xmi:id="p1" name="eye" type="i"/>
</packagedElement>
<packagedElement xmi:type="uml:Component" xmi:id="c2" name="Pilot">
 <ownedAttribute xmi:type="uml:Port" xmi:id="p2" name="sight" type="i" isConjugated="true"/>
</packagedElement>
<packagedElement xmi:type="uml:Component" xmi:id="c3" name="Store">
 <interfaceRealization xmi:id="r" client="c3" supplier="i" contract="i"/>
</packagedElement>"""
SYSTEM = """
<packagedElement xmi:type="uml:Component" xmi:id="s" name="Plant">
 <ownedAttribute xmi:type="uml:Property" xmi:id="a1" name="lens" type="c1"/>
 <ownedAttribute xmi:type="uml:Property" xmi:id="a2" name="pilot" type="c2"/>
 <ownedConnector xmi:type="uml:Connector" xmi:id="k">
  <end xmi:type="uml:ConnectorEnd" xmi:id="e1" role="p2" partWithPort="a2"/>
  <end xmi:type="uml:ConnectorEnd" xmi:id="e2" role="p1" partWithPort="a1"/>
 </ownedConnector>
</packagedElement>"""
STEPS = """
<packagedElement xmi:type="uml:Node" xmi:id="n" name="board"/>
<packagedElement xmi:type="uml:Activity" xmi:id="a" name="Serve">
 <group xmi:type="uml:ActivityPartition" xmi:id="g1" name="parser"/>
 <group xmi:type="uml:ActivityPartition" xmi:id="g2" name="store"/>
 <node xmi:type="uml:InitialNode" xmi:id="n0" name="start"/>
 <node xmi:type="uml:OpaqueAction" xmi:id="n1" name="parse" inPartition="g1"/>
 <node xmi:type="uml:OpaqueAction" xmi:id="n2" name="keep it" inPartition="g2"/>
 <node xmi:type="uml:OpaqueAction" xmi:id="n3" name="guess" inPartition="g2"/>
 <edge xmi:type="uml:ControlFlow" xmi:id="f" source="n1" target="n2"/>
</packagedElement>"""
APPLIED = """
<GQAM:GaExecHost xmi:id="x0" base_Classifier="n" resMult="2" schedPolicy="RoundRobin"/>
<GQAM:GaStep xmi:id="x1" base_NamedElement="n1">
 <hostDemand>(value=5,unit=ms,source=est)</hostDemand></GQAM:GaStep>
<PAM:PaStep xmi:id="x2" base_NamedElement="n2" hostDemand="3 ms"/>
<GQAM:GaStep xmi:id="x3" base_NamedElement="n3" hostDemand="(expr=$t,unit=ms)"/>
<GQAM:GaStep xmi:id="x4" base_NamedElement="f" prob="0.5"/>
<GQAM:GaWorkloadEvent xmi:id="x5" base_NamedElement="n0"
 pattern="open=(arrivalRate=(expr=5.0, unit=Hz, source=est))"/>
<PAM:PaRunTInstance xmi:id="x6" base_NamedElement="g1" host="x0"/>
<GQAM:GaAnalysisContext xmi:id="x7" base_NamedElement="a"/>"""
TAIL = "</uml:Model></xmi:XMI>"


def text_of(*elements, applied=""):
    return f"{HEAD}{''.join(elements)}</uml:Model>{applied}</xmi:XMI>".encode()


def test_plain_components_ports_and_connectors_are_imported_without_files():
    imported = read("plain", text_of(PLAIN, SYSTEM))
    assert imported.tree["components"] == {
        "Lens": {"language": "python", "provides": {"eye": "Scan"}},
        "Pilot": {"language": "python", "requires": {"sight": "Scan"}},
        "Store": {"language": "python", "provides": {"scan": "Scan"}},
    }
    assert imported.tree["application"] == {
        "lens": {"is": "Lens"},
        "pilot": {"is": "Pilot", "sight": "lens.eye"},
    }
    assert not any(one.lost for one in imported.notes)
    alone = read("plain", text_of(PLAIN)).tree
    assert alone["application"] == {name: {"is": name.title()} for name in ("lens", "pilot", "store")}
    text, _ = export_uml(imported.tree, "plain.uml", base=imported)
    assert read("plain", text.encode()).tree == imported.tree


def test_hosts_steps_and_workloads_become_processors_times_and_arrivals():
    imported = read("steps", text_of(STEPS, applied=APPLIED))
    tree = imported.tree
    assert tree["interfaces"] == {"parser_steps": {"parse": {}}, "store_steps": {"keep_it": {}, "guess": {}}}
    assert tree["components"]["parser"] == {
        "language": "python",
        "provides": {"steps": "parser_steps"},
        "operations": {"parse": {"time": "5 ms", "provenance": "estimated"}},
        "active": {"period": "0.2 s"},
    }
    assert tree["components"]["store"]["operations"] == {"keep_it": {"time": "3 ms"}}
    assert tree["platform"]["processors"] == {
        "board": {"is": "board", "cores": 2, "scheduler": "round-robin"}
    }
    assert tree["allocations"] == {"default": {"parser_1": "board", "store_1": "board"}}
    lost = [str(one) for one in imported.notes if one.lost]
    for what in (
        "'(expr=$t,unit=ms)' is no figure",
        "a step on an edge",
        "«GaAnalysisContext», applied once",
    ):
        assert any(what in one for one in lost), what
    assert len(lost) == 3
    for base in (None, imported):
        text, _ = export_uml(tree, "steps.uml", base=base)
        again = read("steps", text.encode()).tree
        assert {key: again[key] for key in ("components", "interfaces", "application")} == {
            key: tree[key] for key in ("components", "interfaces", "application")
        }


@pytest.mark.parametrize(
    ("technology", "host", "scenario", "workload", "step"),
    [
        ("Storm", "GQAM:GaExecHost", "StormScenarioTopology", "GQAM:GaWorkloadEvent", "StormBolt"),
        ("Hadoop", "T:HadoopComputationNode", "HadoopScenario", "T:HadoopWorkloadEvent", "HadoopOperation"),
        ("Spark", "T:SparkNode", "SparkScenario", "T:SparkWorkloadEvent", "SparkTransformation"),
    ],
)
def test_steps_and_hosts_of_dice_are_those_of_marte(technology, host, scenario, workload, step):
    elements = """<packagedElement xmi:type="uml:Node" xmi:id="n" name="board">
 <nestedClassifier xmi:type="uml:Artifact" xmi:id="f" name="counter"/></packagedElement>
<packagedElement xmi:type="uml:Node" xmi:id="n2" name="other"/>
<packagedElement xmi:type="uml:Activity" xmi:id="a" name="Topology">
 <group xmi:type="uml:ActivityPartition" xmi:id="g" name="lane" represents="f"/>
 <node xmi:type="uml:InitialNode" xmi:id="n0" name="start"/>
 <node xmi:type="uml:OpaqueAction" xmi:id="n1" name="count" inPartition="g"/>
 <node xmi:type="uml:OpaqueAction" xmi:id="n3" name="sum"/></packagedElement>"""
    applied = f"""<{host} xmi:id="x0" base_Classifier="n"/><{host} xmi:id="x1" base_Classifier="n2"/>
<T:{scenario} xmi:id="x2" base_NamedElement="a" usedResources="x1"/>
<{workload} xmi:id="x3" base_NamedElement="n0"/><T:{step} xmi:id="x4" base_Classifier="f"/>
<T:{step} xmi:id="x5" base_Action="n1"><hostDemand>(expr=5,unit=ms,source=est)</hostDemand></T:{step}>
<T:{step} xmi:id="x6" base_Action="n3"><hostDemand>(expr=2,unit=ms,source=est)</hostDemand></T:{step}>"""
    namespace = f"http://es.unizar.disco.dice/profiles/DTSM/{technology}/1.0"
    text = text_of(elements, applied=applied).replace(
        b"xmlns:PAM", f'xmlns:T="{namespace}" xmlns:PAM'.encode()
    )
    imported = read("dice", text)
    tree = imported.tree
    assert tree["components"]["counter"]["operations"] == {
        "count": {"time": "5 ms", "provenance": "estimated"}
    }
    assert list(tree["components"]["Topology"]["operations"]) == ["sum"]
    assert set(tree["platform"]["processors"]) == {"board", "other"}
    assert tree["allocations"] == {"default": {"counter_1": "board", "topology": "other"}}
    assert not any(
        "profile that is not read" in line or "has no counterpart" in line for line in said(imported)
    )


EXPOSED = """
<packagedElement xmi:type="uml:Component" xmi:id="c1" name="Lens">
 <ownedAttribute xmi:type="uml:Port" xmi:id="p1" name="eye">
  <provided xmi:type="uml:Interface" xmi:id="i1" name="Scan">
   <ownedOperation xmi:id="o" name="look"/></provided>
 </ownedAttribute>
</packagedElement>
<packagedElement xmi:type="uml:Component" xmi:id="c2" name="Pilot">
 <ownedAttribute xmi:type="uml:Port" xmi:id="p2" name="sight">
  <required xmi:id="i2" name="Scan"/></ownedAttribute>
 <ownedAttribute xmi:type="uml:Port" xmi:id="p3" name="book"><provided xmi:idref="i3"/></ownedAttribute>
</packagedElement>
<packagedElement xmi:type="uml:Component" xmi:id="c3" name="Store">
 <provided xmi:id="i4" name="Log"/><required xmi:id="i5" name="Scan"/>
</packagedElement>
<packagedElement xmi:type="uml:Interface" xmi:id="i3" name="Log">
 <ownedOperation xmi:id="o3" name="add"/></packagedElement>"""


def test_interfaces_below_ports_and_components_as_enterprise_architect_writes_them():
    tree = read("exposed", text_of(EXPOSED, SYSTEM)).tree
    assert tree["interfaces"] == {"Log": {"add": {}}, "Scan": {"look": {}}}
    assert tree["components"] == {
        "Lens": {"language": "python", "provides": {"eye": "Scan"}},
        "Pilot": {"language": "python", "provides": {"book": "Log"}, "requires": {"sight": "Scan"}},
        "Store": {"language": "python", "provides": {"log": "Log"}, "requires": {"scan": "Scan"}},
    }
    assert tree["application"]["pilot"] == {"is": "Pilot", "sight": "lens.eye"}


def test_a_file_without_a_component_lists_its_stereotypes():
    applied = APPLIED.replace("GaStep", "Other").replace("PaStep", "Other")
    with pytest.raises(
        ModelError, match=r"nothing in it is a component. Its stereotypes: Other 4, GaExecHost 1"
    ):
        read("steps", text_of(STEPS, applied=applied))


SUB = f"""{HEAD}<packagedElement xmi:type="uml:Package" xmi:id="deep" name="Deep">
{SYSTEM.replace('type="c', 'type="main.uml#c').replace('role="p', 'role="main.uml#p')}
</packagedElement>{TAIL}"""
MAIN = f'<packagedElement href="below/sub.uml#deep"/>{PLAIN}'


def test_a_submodel_in_another_file_is_followed(tmp_path):
    (tmp_path / "below").mkdir()
    (tmp_path / "main.uml").write_bytes(text_of(MAIN))
    (tmp_path / "below" / "sub.uml").write_text(SUB)
    imported = read_uml(tmp_path / "main.uml", tmp_path, CATALOGUE)
    assert imported.tree["application"]["pilot"] == {"is": "Pilot", "sight": "lens.eye"}
    (tmp_path / "model.yaml").write_text(model_text(imported.tree))
    with pytest.raises(UsageError, match=r"has parts in other files \(below/sub.uml\): export to a new file"):
        export_model(tmp_path / "model.yaml", tmp_path / "main.uml", vocabulary())
    (tmp_path / "below" / "sub.uml").unlink()
    with pytest.raises(ModelError, match=r"its submodel below/sub.uml cannot be read: No such file"):
        read_uml(tmp_path / "main.uml", tmp_path, CATALOGUE)


@pytest.mark.parametrize("outside", ["../secret.uml", "/etc/secret.uml", "http://host/secret.uml"])
def test_nothing_outside_the_folder_is_read_for_a_submodel(tmp_path, outside):
    (tmp_path / "main.uml").write_bytes(text_of(f'<packagedElement href="{outside}#deep"/>', PLAIN))
    assert "Lens" in read_uml(tmp_path / "main.uml", tmp_path, CATALOGUE).tree["components"]
    (tmp_path / "link.uml").symlink_to("/dev/null")
    (tmp_path / "main.uml").write_bytes(text_of('<packagedElement href="link.uml#deep"/>', PLAIN))
    with pytest.raises(ModelError, match="it is outside the folder of the model"):
        read_uml(tmp_path / "main.uml", tmp_path, CATALOGUE)


def test_an_id_that_stands_twice_is_said():
    doubled = PLAIN.replace('xmi:id="c2"', 'xmi:id="c1"')
    assert any("another element has its id" in one for one in said(read("plain", text_of(doubled))))


@pytest.mark.parametrize(
    ("ending", "words"), [("mdzip", "Eclipse UML2 XMI"), ("mdj", "XMI extension"), ("qea", "XMI 2.1")]
)
def test_containers_of_other_tools_are_named_with_the_way_to_xmi(tmp_path, ending, words):
    (tmp_path / f"m.{ending}").write_bytes(b"PK")
    with pytest.raises(ModelError, match=words):
        read_uml(tmp_path / f"m.{ending}", tmp_path, CATALOGUE)


def test_a_model_of_very_many_elements_is_refused():
    with pytest.raises(ModelError, match="elements; 200000 are read at most"):
        read("many", text_of("<a/>" * 200_001))


def test_what_was_imported_can_be_written_again_without_a_frequency(tmp_path):
    (tmp_path / "steps.uml").write_bytes(text_of(STEPS, applied=APPLIED))
    import_model(tmp_path / "steps.uml", tmp_path / "model.yaml", CATALOGUE)
    for name in ("steps.uml", "new.uml", "m.aadl", "m.sysml"):
        export_model(tmp_path / "model.yaml", tmp_path / name, vocabulary())
        assert (tmp_path / name).stat().st_size > 0
