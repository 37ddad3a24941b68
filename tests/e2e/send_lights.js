// Sends lights as third-party programs do: E1.31 by npm's sacn, Art-Net by npm's artnet. A line on
// standard input is [universe, [value, …]], from the first channel on.
// usage: send_lights.js NODE_MODULES e131|artnet PORT
const readline = require('readline');
const [modules, protocol, port] = process.argv.slice(2);

const senders = new Map();
const artnet = protocol === 'artnet'
  ? require(`${modules}/artnet`)({host: '127.0.0.1', port: Number(port), refresh: 3600000}) : null;

async function send(universe, values) {
  if (artnet) {
    artnet.set(universe, 1, values);
    return;
  }
  if (!senders.has(universe)) {
    const {Sender} = require(`${modules}/sacn`);
    senders.set(universe, new Sender({universe, port: Number(port), useUnicastDestination: '127.0.0.1',
                                      defaultPacketOptions: {useRawDmxValues: true, sourceName: 'a desk'}}));
  }
  const payload = Object.fromEntries(values.map((value, i) => [i + 1, value]));
  await senders.get(universe).send({payload, priority: 100});
}

(async () => {
  for await (const line of readline.createInterface({input: process.stdin})) {
    const [universe, values] = JSON.parse(line);
    await send(universe, values);
  }
  process.exit(0);
})();
