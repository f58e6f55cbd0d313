#!/usr/bin/env bash
# pyecore 0.15.2: an enumeration value that Eclipse has saved is read as None.
#
# An Ecore literal has a name, a number and a `literal`, the text by which EMF saves it ("armed state" for the name ARMED).
# pyecore reads and writes the name. A model from Eclipse gives None for such an attribute, without an error, and so does the
# default value of the metamodel; what pyecore saves, `state="ARMED"`, is no literal for Eclipse. `literal` itself is kept.
# Seen: read None, default None, literal "armed state", written state="ARMED"
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyecore==0.15.2
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys

from pyecore.resources import URI, ResourceSet

folder = pathlib.Path(sys.argv[1])
folder.joinpath("drone.ecore").write_text("""<?xml version="1.0" encoding="UTF-8"?>
<ecore:EPackage xmi:version="2.0" xmlns:xmi="http://www.omg.org/XMI" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
    xmlns:ecore="http://www.eclipse.org/emf/2002/Ecore" name="drone" nsURI="http://drone" nsPrefix="drone">
  <eClassifiers xsi:type="ecore:EClass" name="Drone">
    <eStructuralFeatures xsi:type="ecore:EAttribute" name="state" eType="#//State"/>
    <eStructuralFeatures xsi:type="ecore:EAttribute" name="first" eType="#//State" defaultValueLiteral="armed state"/>
  </eClassifiers>
  <eClassifiers xsi:type="ecore:EEnum" name="State">
    <eLiterals name="IDLE" literal="idle state"/>
    <eLiterals name="ARMED" value="1" literal="armed state"/>
  </eClassifiers>
</ecore:EPackage>
""")
folder.joinpath("saved.xmi").write_text("""<?xml version="1.0" encoding="UTF-8"?>
<drone:Drone xmi:version="2.0" xmlns:xmi="http://www.omg.org/XMI" xmlns:drone="http://drone" state="armed state"/>
""")
resources = ResourceSet()
package = resources.get_resource(URI(str(folder / "drone.ecore"))).contents[0]
resources.metamodel_registry[package.nsURI] = package
read = resources.get_resource(URI(str(folder / "saved.xmi"))).contents[0]
armed = package.getEClassifier("State").getEEnumLiteral("ARMED")
own = package.getEClassifier("Drone")()
own.state = armed
resource = resources.create_resource(URI(str(folder / "own.xmi")))
resource.append(own)
resource.save()
written = folder.joinpath("own.xmi").read_text().split('state="')[1].split('"')[0]
seen = read.state, read.first, armed.literal, written
print(*seen)
sys.exit(seen != (None, None, "armed state", "ARMED"))
PYTHON
