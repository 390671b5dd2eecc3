# Puts our own package into the environment and writes the bill of materials: finish.sh NAME_OF_THE_IMAGE
set -eu
pip --python /opt/rover-twin/bin/python install --no-deps /wheel/*.whl
rm -rf /opt/rover-twin/include "$PACKAGES/model_store/models" "$PACKAGES/model_store/datasets"
bom=/opt/rover-twin/sbom.cdx.json
/opt/bom/bin/cyclonedx-py environment --output-reproducible --spec-version 1.6 --output-format JSON --output-file $bom \
    /opt/rover-twin/bin/python
/opt/bom/bin/python docker/making/bom.py $bom "$1" /opt/rover-twin
chmod 644 $bom
