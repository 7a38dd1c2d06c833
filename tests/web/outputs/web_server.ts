// A web server for pages that draw what was solved.

import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';

export interface Served {
  body: Buffer;
  type: string;
}

/** Answers what `serve` has for a path, and 404 where that throws. */
export class WebServer {
  private readonly server: Server;

  constructor(serve: (url: string) => Served) {
    this.server = createServer((request, response) => {
      try {
        const { body, type } = serve(request.url ?? '/');
        response.writeHead(200, { 'Content-Type': type }).end(body);
      } catch {
        response.writeHead(404).end();
      }
    });
  }

  async launch(): Promise<void> {
    await new Promise<void>((resolve) => this.server.listen(0, '127.0.0.1', resolve));
  }
  quit(): void {
    this.server.close();
  }
  /** Of the root. */
  get url(): string {
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}/`;
  }
}
