#!/usr/bin/env bash
# pythonfmu 0.7.0, FMPy 0.3.32: an FMU with an integer output is built without a word and refused by the reader.
#
# FMI 2 takes the variability "continuous" where none is given and allows it for Real alone. `Integer("count", causality=output)`,
# as pythonfmu's own introduction has it, is written without a variability, and so are Boolean and String. FMPy then answers with
# "must have variability != continuous". A Real output, and an Integer told `variability=discrete`, pass.
# Seen: built; ValidationError for the Integer, none for the Real
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pythonfmu==0.7.0 FMPy==0.3.32 numpy==2.4.6
for kind in Integer Real; do
  cat > "$kind"Counter.py <<PYTHON
from pythonfmu import Fmi2Causality, Fmi2Slave, $kind


class ${kind}Counter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.count = 1
        self.register_variable($kind("count", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
PYTHON
  venv/bin/python -m pythonfmu build -f "$kind"Counter.py > build.log 2>&1
done
venv/bin/python - <<'PYTHON'
import sys

from fmpy import read_model_description
from fmpy.model_description import ValidationError

seen = {}
for kind in ("Integer", "Real"):
    try:
        seen[kind] = read_model_description(f"{kind}Counter.fmu").modelVariables[0].variability
    except ValidationError as error:
        seen[kind] = str(error)
print(seen)
sys.exit("must have variability" not in seen["Integer"] or seen["Real"] != "continuous")
PYTHON
