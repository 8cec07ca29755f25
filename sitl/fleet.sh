#!/bin/sh
# Start K ArduPilot boats side by side, without Python: for containers, or where mrmission runs on
# another machine. They end with this script. With Python, `mrmission sim --engine ardupilot` does
# more: it waits until they are ready, watches them, and checks ports and parameters first.
#
#   K=6 BERTH=14.0023,59.9972 SPEEDUP=5 MODEL=motorboat ./fleet.sh
#
# Boat i (from 0) has system id i + 1 and TCP ports PORT + 10 i and two above; 15 m lie between two.
set -eu

K=${K:-1}
BERTH=${BERTH:--81.25,34.06}
SPEEDUP=${SPEEDUP:-1}
MODEL=${MODEL:-motorboat}
PORT=${PORT:-5760}
PROGRAM=${ARDUROVER:-ardurover}

here=$(cd "$(dirname "$0")" && pwd)
files="$here/common.parm,$here/boat.parm"
case $MODEL in
  motorboat) ;;
  motorboat-skid) files="$files,$here/skid.parm" ;;
  *) echo "MODEL=$MODEL: must be motorboat or motorboat-skid" >&2; exit 2 ;;
esac
command -v "$PROGRAM" >/dev/null || {
  echo "no $PROGRAM: it is part of ArduPilot; see sitl/README.md" >&2
  exit 5
}

work=$(mktemp -d)
pids=
end() {
  trap - EXIT INT TERM HUP
  for pid in $pids; do kill "$pid" 2>/dev/null || true; done
  wait
  rm -rf "$work"
}
trap end EXIT
trap 'exit 0' INT TERM HUP

i=0
while [ "$i" -lt "$K" ]; do
  # To the right of the first, and 8 m ahead: they go astern by that before they are ready.
  place=$(awk -v berth="$BERTH" -v i="$i" 'BEGIN {
    split(berth, at, ",")
    metre = 1 / 111319.4908
    printf "%.8f,%.8f", at[2] + 8 * metre, at[1] + 15 * i * metre / cos(at[2] * 3.14159265 / 180)
  }')
  port=$((PORT + 10 * i))
  mkdir "$work/$i"
  cd "$work/$i"
  "$PROGRAM" --model "$MODEL" -I "$i" --sysid $((i + 1)) --home "$place,1,0" \
    --speedup "$SPEEDUP" --defaults "$files" --serial0 "tcp:$port" \
    --serial1 "tcp:$((port + 2))" --serial2 none: --rc-in-port "$port" \
    </dev/null >"$work/$i/output.txt" 2>&1 &
  pids="$pids $!"
  echo "boat $((i + 1))  tcp:127.0.0.1:$port  at $place"
  i=$((i + 1))
done
echo "boats are ready some 42 simulated seconds from now; Ctrl-C ends them"

# A boat that ends by itself ends all.
while :; do
  for pid in $pids; do
    kill -0 "$pid" 2>/dev/null || {
      echo "a boat ended:" >&2
      tail -n 3 "$work"/*/output.txt >&2
      exit 5
    }
  done
  sleep 1 &
  wait $!
done
