#!/bin/sh
# Install Chromium and its driver on Debian; say so where that is not possible.
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    echo 'Chromium is missing and cannot be installed here: its test will skip'
    exit 0
fi
export DEBIAN_FRONTEND=noninteractive
{
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends chromium chromium-driver
} >/dev/null 2>&1 || echo 'Chromium could not be installed: its test will skip'
