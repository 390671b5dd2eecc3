# Takes out of the base image what is only there to install more, or to be read by people: pip, package lists and
# archives, manuals, translations. Licences stay. No program keeps the right to act as another user.
set -eu
rm -rf /var/lib/apt/lists/* /var/cache/* /var/log/* /root/.cache /usr/share/man /usr/share/info /usr/share/locale \
    /usr/share/python-wheels /usr/share/lintian
find /usr/share/doc -type f ! -name copyright -delete
find /usr/lib/python3* /usr/local/lib/python3* -depth ! -path '/usr/lib/python3*/__pycache__/*' \
    '(' -path '*-packages/pip' -o -path '*-packages/pip-*' -o -path '*-packages/setuptools*' -o -path '*-packages/pkg_resources' \
    -o -path '*-packages/wheel' -o -path '*-packages/wheel-*' -o -path '*-packages/_distutils_hack' \
    -o -name ensurepip -o -name idlelib -o -name lib2to3 -o -path '*/python3*/test' ')' -exec rm -rf '{}' +
rm -f /usr/local/bin/pip* /usr/bin/pip*
find / -xdev -type f -perm /6000 -exec chmod a-s '{}' + 2>/dev/null || true
rm -f /tmp/system.sh
